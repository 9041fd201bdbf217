#include "apps/slam/map_merge.h"

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>

#include "apps/slam/loop_constraint.h"
#include "apps/slam/map_connection.h"
#include "apps/slam/map_state.h"
#include "frontend/map/append.h"

namespace tutti {
namespace {

// A loop from a place of the map, shown to the other one's detector with frame numbers from `offset` on, to a
// place of that one: turned round, and in the numbers of the merged map.
void TurnRound(std::int64_t offset, std::int64_t first_frame, int first_keyframe, ProposedLoop* loop) {
  loop->verification = Reversed(loop->verification, loop->record.query - offset);
  LoopRecord& record = loop->record;
  std::swap(record.query, record.candidate);
  std::swap(record.query_stamp_s, record.candidate_stamp_s);
  record.query += first_frame;
  record.candidate -= offset;
  std::swap(loop->query, loop->candidate);
  loop->query += first_keyframe;
}

}  // namespace

bool ComesAfter(const MapInfo& map, const MapInfo& other) {
  const auto settings = [](const MapInfo& info) {
    RunConfig config = info.config;
    config.dataset = {};
    return StateOf(config) + StateOf(info.rig);
  };
  if (settings(map) != settings(other)) return false;
  const auto key = [](const MapInfo& i) {
    return std::tuple(i.first_stamp_s, i.last_stamp_s, i.frames, i.keyframes, i.landmarks, i.loops,
                      i.least.norm(), i.most.norm());
  };
  return key(other) < key(map);
}

void MapMerge::Append() {
  places_ = map_.loops.Places();
  others_ = other_.loops.Places();
  first_frame_ = map_.sessions.NextOffset(map_.odometry);
  first_keyframe_ = map_.odometry.map().KeyframeCount();
  first_piece_ = map_.odometry.map().NextPiece();
  Map both = map_.odometry.map();
  tutti::Append(other_.odometry.map(), first_frame_, &both);
  map_.odometry =
      Odometry(map_.odometry, std::move(both), first_frame_ + other_.odometry.LastView().frame_offset);
  map_.loops.Append(other_.loops, first_frame_, first_keyframe_);
  map_.sessions.Append(other_.sessions, first_frame_, first_piece_);
}

bool MapMerge::Join(std::int64_t frames, const std::function<void(const LoopUpdate&)>& take,
                    std::string* reason) {
  *reason = map_.loops.Join(LoopsBetween(), map_.odometry, frames);
  while (const auto update = map_.loops.Rest(&map_.odometry, frames)) take(*update);
  const std::vector<int> ids = map_.odometry.map().KeyframeIds();
  const auto joined =
      std::find_if(std::lower_bound(ids.begin(), ids.end(), first_keyframe_), ids.end(),
                   [&](int id) { return map_.odometry.map().keyframe(id).piece < first_piece_; });
  if (joined == ids.end()) {
    if (reason->empty()) *reason = "the loops between them contradict the maps";
    return false;
  }
  MapConnection(config_, map_.rig, frames, &map_.loops, &map_.odometry, take)
      .Connect(map_.odometry.map().keyframe(*joined).piece);
  return true;
}

// By both detectors, each pair of places once.
std::vector<ProposedLoop> MapMerge::LoopsBetween() {
  std::vector<ProposedLoop> loops = ProposedByMap();
  for (ProposedLoop& loop : ProposedByOther()) {
    const auto known = std::find_if(loops.begin(), loops.end(), [&loop](const ProposedLoop& l) {
      return l.candidate == loop.candidate && l.query == loop.query;
    });
    if (known == loops.end()) {
      loops.push_back(std::move(loop));
    } else if (loop.record.verified && !known->record.verified) {
      *known = std::move(loop);
    }
  }
  return loops;
}

std::vector<ProposedLoop> MapMerge::ProposedByMap() {
  return map_.loops.Compare(std::move(others_), first_frame_, [&](std::int64_t frame) {
    const int keyframe = other_.loops.KeyframeOf(frame);
    return keyframe >= 0 ? std::optional(ViewOf(map_.odometry.map(), first_keyframe_ + keyframe))
                         : std::nullopt;
  });
}

// The other map's detector is shown the places of this one, as the recording that comes next there.
std::vector<ProposedLoop> MapMerge::ProposedByOther() {
  const std::int64_t offset = other_.sessions.NextOffset(other_.odometry);
  int pieces = 0;  // there; those of this map are others
  for (const int id : other_.odometry.map().KeyframeIds())
    pieces = std::max(pieces, other_.odometry.map().keyframe(id).piece + 1);
  other_.loops.BeginSession(map_.rig, offset, other_.odometry.map().KeyframeCount());
  std::vector<ProposedLoop> loops = other_.loops.Compare(
      std::move(places_), offset, [&](std::int64_t frame) -> std::optional<KeyframeView> {
        const int keyframe = map_.loops.KeyframeOf(frame);
        if (keyframe < 0) return std::nullopt;
        KeyframeView view = ViewOf(map_.odometry.map(), keyframe);
        view.map_piece += pieces;
        return view;
      });
  for (ProposedLoop& loop : loops) TurnRound(offset, first_frame_, first_keyframe_, &loop);
  return loops;
}

}  // namespace tutti
