// Mapping of a keyframe beside the tracking of the next frames.
#pragma once

#include <cassert>
#include <future>
#include <memory>
#include <utility>
#include <vector>

#include "core/stopwatch.h"
#include "frontend/map/local_mapper.h"
#include "frontend/odometry/tracked_frame.h"
#include "tutti/frontend/map.h"

namespace tutti {

/// Owns the map, and has LocalMapper treat one keyframe at a time on a copy of it, on a thread of its own if
/// wanted. The result enters a fixed number of frames later whenever it is ready, so that threads change
/// nothing but the time. Value type; copies share the work that is under way.
class AsyncMapper {
 public:
  AsyncMapper(const OdometryOptions& options, const CameraRig& rig);

  const Map& map() const { return map_; }
  /// For writing, while nothing is under way.
  Map* MutableMap() {
    assert(!Busy());
    return &map_;
  }
  /// For writing frames, also while something is under way.
  Map* MapOfFrames() { return &map_; }
  const SelfCalibration& lens() const { return mapper_.lens(); }
  void KeepLens(const SelfCalibration& lens) { mapper_.KeepLens(lens); }

  /// Adds a keyframe with the landmarks that the frame sees, and new ones by its depth, if the sensor has
  /// that. Nothing may be under way. Returns its id.
  int AddKeyframe(const TrackedFrame& frame, int piece, const Pose& T_world_camera,
                  const std::vector<int>& landmarks);
  /// Begins with the newest keyframe. `stages`: for the recorder. Nothing may be under way.
  void Start(int keyframe, const StageTimes& stages);
  /// A keyframe that needs no more treatment.
  void Skip(int keyframe) { mapped_.push_back(keyframe); }

  /// LocalMapper::KeepPoses. Nothing may be under way.
  void KeepPoses() { mapper_.KeepPoses(); }

  /// LocalMapper::Keep, of all that is in the map. Nothing may be under way.
  void KeepMap() { mapper_.Keep(map_); }

  bool Busy() const { return outcome_.valid(); }
  void NextFrame() { ++frames_; }
  /// True if the result is to enter now.
  bool Due() const { return Busy() && frames_ >= delay_frames_; }
  /// Waits for the result and brings it in: keyframes move, landmarks are merged or gone. Adds its times to
  /// `stages`. Something must be under way.
  void Enter(StageTimes* stages);

  /// Counts which landmarks a frame should see and does; what is under way is waited for.
  void CountSeen(const PoseFix& fix);
  /// Keyframes that were mapped since the last call, oldest first.
  std::vector<int> TakeMapped() { return std::exchange(mapped_, {}); }

  /// false: mapping is done on the thread that waits for it.
  void UseOwnThreads(bool own_threads) { own_threads_ = own_threads; }
  bool own_threads() const { return own_threads_; }

  /// All but the map, and without what has come of the work that is under way: that follows from the rest.
  template <class Archive>
  void State(Archive& archive) {
    bool busy = Busy();
    archive(mapper_, busy, keyframe_, frames_, visible_, found_, mapped_);
    if (Archive::kReading) interrupted_ = busy;
  }
  /// For loading: the map to be filled.
  Map* RestoredMap() { return &map_; }
  /// Throws InputError if the state does not fit together.
  void Check(const internal::SectionReader& file) const;
  /// Whether something was under way when the state was saved, and is not yet begun again.
  bool interrupted() const { return interrupted_; }
  /// Begins with that again.
  void Resume(const StageTimes& stages);

 private:
  struct Outcome {
    Map map;
    LocalMapper mapper;
    StageTimes stages;  // of this keyframe alone
  };
  void Count(std::vector<int>* landmarks, int Landmark::*counter);

  int delay_frames_;
  bool has_depth_;
  bool own_threads_ = true;
  Map map_;  // not written to while Busy()
  LocalMapper mapper_;
  std::shared_future<std::shared_ptr<const Outcome>> outcome_;  // valid: under way
  int keyframe_ = -1;                                           // that is under way
  int frames_ = 0;                                              // since that began
  bool interrupted_ = false;                                    // loaded, and not begun again yet
  std::vector<int> visible_, found_;                            // landmarks that are still to be counted
  std::vector<int> mapped_;
};

}  // namespace tutti
