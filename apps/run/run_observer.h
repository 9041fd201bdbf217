// A window into a run: the report, the live view and the comparison's shared odometry look through it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "tutti/frontend/frame.h"
#include "tutti/frontend/odometry.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/slam/loop.h"

namespace tutti {

/// The map and its loops at one moment of a run.
struct RunState {
  const Odometry* odometry = nullptr;  ///< null: appearance only
  const std::vector<Loop>& loops;
  int corrections = 0;      ///< how often loops have moved the map
  bool recognised = false;  ///< of OnFrame: the frame was lost, or the first, and the detector knew its place
  /// MapSession::frame_offset of the recordings of the map, which are in the order of their numbers.
  std::vector<std::int64_t> sessions = {0};
  /// Frames are only located (Localizer): keyframes from this id on are none of the
  /// map's.
  int end_of_map = std::numeric_limits<int>::max();

  /// What has a smaller frame number is of an earlier recording than the newest.
  std::int64_t FirstFrame() const { return sessions.back(); }
  /// The frames of the newest recording.
  FrameRange Session() const {
    FrameRange session;
    if (FirstFrame() > 0) session.first = FirstFrame();
    return session;
  }
  /// The recording of a frame, by its number in the map.
  std::size_t SessionOf(std::int64_t frame) const {
    const auto next = std::upper_bound(sessions.begin() + 1, sessions.end(), frame);
    return static_cast<std::size_t>(next - sessions.begin()) - 1;
  }
  bool OnlyLocated() const { return end_of_map != std::numeric_limits<int>::max(); }
};

/// Watches a run and changes nothing (it may hold it up, as a pause does). All calls come from the thread
/// that tracks, which waits for them; what takes long belongs on another thread. What is passed is valid
/// during the call alone; images may be kept (they are never written to again).
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  /// True: OnDetection gets posterior_by_location and the members' evidence, which costs O(locations x
  /// members) per image.
  virtual bool WantsPosteriors() const { return false; }
  /// The run begins anew, at its first frame, with what it found out of its camera: nothing that came before
  /// counts. OnStart follows.
  virtual void OnRestart() {}
  /// Before the first frame. `frames`: that are to come, 0: nobody knows how many.
  virtual void OnStart(const CameraRig& /*rig*/, std::size_t /*frames*/) {}
  /// After each frame that could be read.
  virtual void OnFrame(const InputFrame& /*frame*/, const TrackResult& /*track*/, const RunState& /*state*/) {
  }
  /// A keyframe whose landmarks are all known now; its frame came a few frames before. Before OnFrame of the
  /// frame in which that happens.
  virtual void OnKeyframe(const InputFrame& /*frame*/, int /*keyframe*/, const RunState& /*state*/) {}
  /// Each answer of the loop detector, in the order of the queries, before the frame in which it enters.
  virtual void OnDetection(const LoopResult& /*result*/) {}
  /// For checkpoints: what it has collected so far goes under this name; "": nothing.
  virtual const char* Name() const { return ""; }
  virtual std::string Save() const { return ""; }
  /// Takes up what Save gave, before OnStart of a run that goes on. `source`: a file, for messages. Throws
  /// InputError if that is damaged.
  virtual void Load(const std::string& /*bytes*/, const std::string& /*source*/) {}
  /// After the last frame, when all loops are in.
  virtual void OnEnd(const RunState& /*state*/) {}
};

}  // namespace tutti
