// The recordings that a map was made of, and which frame numbers are whose.
#pragma once

#include <cstdint>
#include <vector>

#include "core/section_file.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/map_file.h"

namespace tutti {

/// Sessions in their order; the last one goes on. Frames of all have different numbers (MapSession).
class SessionList {
 public:
  SessionList() : sessions_(1) {}

  /// What is added to the numbers of the present one's frames.
  std::int64_t offset() const { return sessions_.back().frame_offset; }
  std::size_t size() const { return sessions_.size(); }
  /// The offset of a session that begins now: past every number that there is.
  std::int64_t NextOffset(const Map& map) const;
  /// Another one begins; its first submap has this number.
  void Begin(std::int64_t frame_offset, int first_piece);
  /// Those of another map, whose frames and submaps have numbers from these on.
  void Append(const SessionList& other, std::int64_t frame_offset, int first_piece);

  /// How many frames the present one has.
  std::int64_t frames() const { return sessions_.back().frames; }
  void CountFrame() { ++sessions_.back().frames; }
  void SetLastFrame(std::int64_t index) { sessions_.back().last_frame = index; }
  /// Notes if the session's frames are by now where something older is.
  void NoteJoined(const Odometry& odometry);

  /// With their keyframes. `map`: null, if there are only appearances.
  std::vector<MapSession> WithKeyframes(const Map* map) const;

  /// What a map file has of them. Throws InputError if that is damaged.
  void Restore(const std::vector<MapSession>& sessions, const Odometry* odometry,
               const internal::SectionReader& file);

 private:
  std::vector<MapSession> sessions_;  // without their keyframes
};

}  // namespace tutti
