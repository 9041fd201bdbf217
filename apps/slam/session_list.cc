#include "apps/slam/session_list.h"

#include <algorithm>
#include <utility>

namespace tutti {

std::int64_t SessionList::NextOffset(const Map& map) const {
  constexpr std::int64_t kRound = 100000;  // one sees which frame of its recording a number is
  std::int64_t highest = sessions_.back().frame_offset + sessions_.back().last_frame;
  for (const int id : map.KeyframeIds()) highest = std::max(highest, map.keyframe(id).frame_index);
  return (std::max<std::int64_t>(0, highest) / kRound + 1) * kRound;
}

void SessionList::Begin(std::int64_t frame_offset, int first_piece) {
  sessions_.emplace_back();
  sessions_.back().frame_offset = frame_offset;
  sessions_.back().first_piece = first_piece;
}

void SessionList::Append(const SessionList& other, std::int64_t frame_offset, int first_piece) {
  for (MapSession session : other.sessions_) {
    session.frame_offset += frame_offset;
    session.first_piece += first_piece;
    sessions_.push_back(std::move(session));
  }
}

void SessionList::NoteJoined(const Odometry& odometry) {
  MapSession& session = sessions_.back();
  if (sessions_.size() < 2 || session.joined_at) return;
  const int reference = odometry.LastView().keyframe;
  if (reference >= 0 && odometry.map().keyframe(reference).piece < session.first_piece)
    session.joined_at = session.last_frame;
}

std::vector<MapSession> SessionList::WithKeyframes(const Map* map) const {
  std::vector<MapSession> sessions = sessions_;
  if (map == nullptr) return sessions;
  std::size_t s = 0;
  for (const int id : map->KeyframeIds()) {
    const std::int64_t frame = map->keyframe(id).frame_index;
    while (s + 1 < sessions.size() && frame >= sessions[s + 1].frame_offset) ++s;
    MapSession& session = sessions[s];
    if (session.keyframes++ == 0) {
      session.first_keyframe = id;
      session.first_stamp_s = map->keyframe(id).stamp_s;
    }
    session.last_keyframe = id;
    session.last_stamp_s = map->keyframe(id).stamp_s;
  }
  return sessions;
}

void SessionList::Restore(const std::vector<MapSession>& sessions, const Odometry* odometry,
                          const internal::SectionReader& file) {
  if (sessions.empty()) file.Damaged("a map of no recording");
  std::int64_t before = -1;
  for (const MapSession& session : sessions) {
    if (session.frame_offset <= before || session.frames < 0)
      file.Damaged("recordings with impossible numbers");
    before = session.frame_offset;
  }
  if (before != (odometry != nullptr ? odometry->LastView().frame_offset : 0))
    file.Damaged("recordings of another map");
  sessions_ = sessions;
  for (MapSession& session : sessions_) {
    session.keyframes = 0;
    session.first_keyframe = session.last_keyframe = -1;
    session.first_stamp_s = session.last_stamp_s = 0;
  }
}

}  // namespace tutti
