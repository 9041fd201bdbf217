// From a verified loop to a corrected map.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "apps/slam/false_loop_source.h"
#include "apps/slam/global_adjuster.h"
#include "apps/slam/loop_constraint.h"
#include "apps/slam/loop_gate.h"
#include "apps/slam/map_graph.h"
#include "tutti/core/span_recorder.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/slam/config.h"
#include "tutti/slam/loop_record.h"

namespace tutti {

/// Measures verified loops against the odometry's map, lets those in that agree, optimises, and moves the
/// map. What becomes of a loop is written into its record.
class LoopCloser {
 public:
  /// `odometry` and `records` must outlive this object and stay where they are. `before_change` is called
  /// before the odometry's map is first changed, and each time after that.
  LoopCloser(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder, Odometry* odometry,
             std::vector<LoopRecord>* records, std::function<void()> before_change);

  /// To be called when there are new keyframes: a mono map begins with two at once.
  void AddKeyframes();

  /// A verified loop between two keyframes, the last of the records. `frames`: number of frames so far.
  void Consider(const Verification& verification, int candidate, int query, std::int64_t frames);
  /// A false loop to the keyframe `query` (any if negative), past detector and gate: what the pose graph
  /// makes of it. False if there is none to make.
  bool Inject(int query, std::int64_t frames);
  /// Brings in what the adjustment of the whole map has found, if it is due.
  void EnterDue(std::int64_t frames);
  /// After the last frame and the last loop.
  void Finish(std::int64_t frames);

  /// Loops of the detector that the map has contradicted since the last call, as input frames (query,
  /// candidate): gate or pose graph refused them, or its robust loss leaves them no weight. Each comes once.
  std::vector<std::pair<std::int64_t, std::int64_t>> TakeRevoked() { return std::exchange(revoked_, {}); }

  PoseGraph Graph() const { return graph_.Build(odometry_, gate_.accepted()); }
  int Corrections() const { return corrections_; }
  int Adjustments() const { return adjustments_; }
  /// Milliseconds spent, summed, by stage.
  const std::map<std::string, double>& StageMilliseconds() const { return stages_; }

 private:
  LoopGate::Map Places() const;
  void BeginChange();
  LoopConstraint Measure(const Verification& verification, int candidate, int query);
  void Gate(std::vector<LoopEdge>& entering);
  void Reject(const LoopEdge& loop, const std::string& reason);
  void Revoke(const LoopEdge& loop);
  void Close(std::vector<LoopEdge> entering, std::int64_t frames);
  void Apply(const MapGraph::Correction& correction, const std::vector<LoopEdge>& entering,
             std::int64_t frames);
  bool Fuse(const std::vector<LoopEdge>& loops);
  void EnterAdjustment();

  SpanRecorder* recorder_;
  SlamOptions options_;
  CameraRig rig_;
  std::uint64_t seed_;
  Odometry& odometry_;
  std::vector<LoopRecord>& records_;
  std::function<void()> before_change_;
  LoopGate gate_;
  int newest_keyframe_ = -1;  // that the graph knows
  MapGraph graph_;
  FalseLoopSource false_loops_;
  GlobalAdjuster adjuster_;
  std::map<std::size_t, LoopEdge> untied_;  // loops that landmarks do not hold together yet, by record
  std::vector<LoopEdge> deferred_;  // agreed, and the map fulfils them: they enter with the next correction
  std::vector<std::pair<std::int64_t, std::int64_t>> revoked_;  // not taken yet
  int corrections_ = 0;
  int adjustments_ = 0;  // of the whole map
  std::map<std::string, double> stages_;
};

}  // namespace tutti
