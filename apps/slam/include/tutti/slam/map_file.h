// A map that outlives its run: what SlamSystem knows, in one file.
//
// A file of sections (tag, checksum, sizes, packed content), written beside its place under a name of its
// own, synced to the disk and renamed: there is always one complete file. docs/maps.md has the reasons and
// the tags.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tutti/frontend/frame.h"
#include "tutti/slam/config.h"

#pragma GCC visibility push(default)
namespace tutti {

/// One recording that a map was made of.
struct MapSession {
  std::string note;  ///< as MapInfo::note
  /// Frames have a number in the map: InputFrame::index in their recording, and this. Those of later sessions
  /// are greater.
  std::int64_t frame_offset = 0;
  std::int64_t frames = 0;       ///< that were tracked
  std::int64_t last_frame = -1;  ///< InputFrame::index of the last of them
  int first_piece = 0;           ///< number of the submap that it began with
  /// InputFrame::index of the frame at which it had joined what was there before: it was recognised, or a
  /// loop had moved the map. None: it stands apart, or is the first.
  std::optional<std::int64_t> joined_at;
  int keyframes = 0;                            ///< of it
  int first_keyframe = -1, last_keyframe = -1;  ///< ids; -1: none
  double first_stamp_s = 0, last_stamp_s = 0;   ///< of these [s]
};

/// What a map file says of itself, without reading the map.
struct MapInfo {
  std::string program;   ///< version of tutti that wrote it
  std::string note;      ///< of whoever had it written: `tutti run` says in JSON what it was called with
  RunConfig config;      ///< of the run; with the seed, without loops.ltm_file
  std::string ltm_file;  ///< that the run had: nobody who reads the map writes it
  CameraRig rig;
  std::int64_t frames = 0;                     ///< that were tracked
  std::int64_t last_frame = 0;                 ///< InputFrame::index of the last one, of the last session
  double first_stamp_s = 0, last_stamp_s = 0;  ///< of keyframes [s]
  int keyframes = 0, landmarks = 0, pieces = 0;
  int loops = 0;                     ///< that are in the map
  std::vector<MapSession> sessions;  ///< recordings, in their order; the last one is what `note` is about
  /// Corners of the box around the keyframes, in the map's frame [m; mono: in units of the first scale].
  Eigen::Vector3d least = Eigen::Vector3d::Zero(), most = Eigen::Vector3d::Zero();
};

/// Reads the first section. Throws InputError that names the file: it is not there, is no map, is of another
/// version, or damaged.
MapInfo ReadMapInfo(const std::filesystem::path& file);

/// Reads all of a map file and verifies its checksums. Throws InputError that says what is wrong.
void CheckMapFile(const std::filesystem::path& file);

/// Takes a section of a map file: its tag and its bytes.
using MapSink = std::function<void(std::uint32_t tag, std::string_view bytes)>;

/// A SlamSystem as it was at one moment, to be written while it goes on (SlamSystem::Snapshot).
class MapSnapshot {
 public:
  /// Writes the file, on any thread, also after the SlamSystem is gone; waits for what was being worked out
  /// beside the tracking at that moment. `more` may add sections of the caller's, with tags from 300 on.
  /// Throws InputError if it can't be written, what was there before is untouched then, or if this was moved
  /// from. A device or a pipe can't be written; a symbolic link is followed.
  void Write(const std::filesystem::path& file, const std::function<void(const MapSink&)>& more = {}) const;

  struct Parts;
  explicit MapSnapshot(std::shared_ptr<const Parts> parts) : parts_(std::move(parts)) {}

 private:
  std::shared_ptr<const Parts> parts_;
};

}  // namespace tutti
#pragma GCC visibility pop
