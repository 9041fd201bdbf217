// Visual SLAM in one class: odometry, ensemble loop closure, pose graph.
//
//   SlamSystem slam(config, dataset->Rig());
//   for (each frame) slam.Track(frame);
//   slam.Finish();
//   slam.odometry()->FrameTrajectory();
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/core/span_recorder.h"
#include "tutti/frontend/odometry.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/slam/config.h"
#include "tutti/slam/loop_record.h"

namespace tutti {

/// The pipeline. The odometry runs on the caller's thread, the loop detector on one of its own; what it finds
/// enters the map a fixed number of frames after its keyframe (run.loop_delay_frames), so the result does not
/// depend on the number of threads or on the machine's load. Without calibration only the detector runs
/// (appearance only).
class SlamSystem {
 public:
  /// Throws InputError if the configuration does not fit the rig. `recorder` gets the time of each stage; it
  /// must outlive this object; null: nothing is recorded.
  SlamSystem(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder = nullptr);
  /// Loop closure on an odometry that is complete (shared_odometry.h): Replay() takes the place of Track(),
  /// and the loops move `tracked`, but no tracking goes on from there. `views`: the keyframes as the detector
  /// is to see them, by id; must outlive this object.
  SlamSystem(const RunConfig& config, const CameraRig& rig, const Odometry& tracked,
             const std::map<int, KeyframeView>& views);
  ~SlamSystem();
  SlamSystem(const SlamSystem&) = delete;
  SlamSystem& operator=(const SlamSystem&) = delete;

  /// Calls `listener` with each answer of the loop detector, before it enters; from Track() and Finish().
  void SetDetectionListener(std::function<void(const LoopResult&)> listener);
  /// Calls `listener` with each keyframe and its frame when all its landmarks are known, which is when the
  /// detector gets it; from Track() and Finish().
  void SetKeyframeListener(std::function<void(const InputFrame&, int)> listener);

  /// Tracks the next frame and brings in the loops that are due. Never throws for hard images.
  TrackResult Track(const InputFrame& frame);
  /// The frame that became this keyframe, again; `frames`: read when the detector got it. Only after the
  /// constructor with a complete odometry, in the order of the keyframes.
  void Replay(const InputFrame& frame, int keyframe, std::int64_t frames);
  /// After the last frame: brings in the loops that are still on their way.
  void Finish();

  /// What went wrong without stopping it (the long-term memory's disk is full) since the last call.
  std::vector<std::string> TakeWarnings();

  /// True if the rig has no calibration: there are loops but no poses.
  bool AppearanceOnly() const;
  /// The odometry with all corrections; nullptr if there are only appearances.
  const Odometry* odometry() const;
  /// The odometry as it was before the detector first changed anything (a loop moved the map, or a lost frame
  /// was found), to be tracked on by whoever wants to know what it would have done alone; nullptr if that
  /// never happened.
  Odometry* untouched();
  /// Index of the last input frame that untouched() has seen.
  std::int64_t UntouchedLast() const;

  /// Every proposed loop in the order of the queries.
  const std::vector<LoopRecord>& loops() const;
  std::size_t LoopsAccepted() const;
  /// Lost frames that got a pose because the detector knew their place.
  std::size_t Relocalized() const;
  /// How often the map was moved.
  int Corrections() const;
  /// How often the whole map was adjusted (bundle adjustment) after loops had moved it.
  int GlobalAdjustments() const;
  /// Keyframes, odometry edges and accepted loops at the present poses.
  PoseGraph Graph() const;
  /// Milliseconds spent, summed, by stage; the detector's run beside the odometry's.
  std::map<std::string, double> StageMilliseconds() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tutti
