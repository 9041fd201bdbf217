// Which loops the pose graph believes, and where it puts the keyframes then.
#pragma once

#include <cstdint>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tutti/backend/keyframe_graph.h"
#include "tutti/core/span_recorder.h"
#include "tutti/slam/slam_options.h"

namespace tutti {

/// How far two transforms disagree: E maps a keyframe's camera onto itself and should be the identity.
struct Disagreement {
  double fraction = 0;   ///< translation as a share of the median scene depth
  double angle_deg = 0;  ///< rotation [deg]
  double log_scale = 0;  ///< |log(scale)|
};
Disagreement Measure(const Similarity& E, double depth);
bool Within(const Disagreement& d, const Disagreement& limits);
/// Too much for a loop that belongs to an optimised map: 8 and 10 of its least standard deviations
/// (loop_constraint.h).
bool Contradicts(const Disagreement& d);

/// What became of an entering loop.
struct LoopVerdict {
  LoopEdge loop;
  std::string reason;                 ///< why it stays out; empty: it is in
  bool contradicted = false;          ///< by the map or the other loops, not for want of a solution
  double weight = 0;                  ///< that the robust loss last gave it
  std::optional<double> gate_sigmas;  ///< Mahalanobis distance from the map, if asked for
};

struct LoopSolution {
  std::vector<LoopVerdict> verdicts;        ///< of the entering loops
  bool moves = false;                       ///< some of them are in, and the map is to move
  KeyframeCorrection correction;            ///< if it moves; loops: the accepted ones, then those that are in
  std::optional<KeyframeGraphProof> proof;  ///< of it, with graph.certify
  double time_ms = 0;
};

/// Optimises with the entering loops; those that the map can't have drifted to (loop_gate_sigmas) or that the
/// rest contradicts leave again, and it is done again without them. `graph`: of the map as it is.
LoopSolution SolveLoops(const KeyframeGraph& graph, const std::vector<LoopEdge>& accepted,
                        const std::vector<LoopEdge>& entering, const SlamOptions& options);

/// The map as it is now (`now`), moved as the solution moves the map that it was made from (`then`): what
/// mapping has found since stays, and keyframes that came since follow the newest one of their map piece.
std::map<int, Similarity> MovedAsSolved(const KeyframeCorrection& solved,
                                        const std::vector<MapKeyframe>& then,
                                        const std::vector<MapKeyframe>& now);

/// Frames from the begin of a solution until it enters: far more than Ceres takes for so many keyframes
/// (docs/backend.md), so that nobody waits for it.
std::int64_t SolutionFrames(std::size_t keyframes);

/// Solves beside the tracking, one at a time.
class BackgroundLoopSolver {
 public:
  BackgroundLoopSolver() = default;
  /// Waits for it if it has a recorder, which need not outlive this.
  ~BackgroundLoopSolver() {
    if (recorded_ && Running()) solution_.wait();
  }
  BackgroundLoopSolver(const BackgroundLoopSolver&) = delete;
  BackgroundLoopSolver& operator=(const BackgroundLoopSolver&) = delete;

  bool Running() const { return solution_.valid(); }
  /// On a thread of its own, or put off until Take(); with the same result. `recorder` may be null.
  void Start(const KeyframeGraph& graph, const std::vector<LoopEdge>& accepted,
             const std::vector<LoopEdge>& entering, const SlamOptions& options, SpanRecorder* recorder);
  /// Waits for it. Nothing is running then.
  LoopSolution Take() { return *std::exchange(solution_, {}).get(); }

  /// What will have been found, for a saved map; not valid if nothing is running.
  using Pending = std::shared_future<std::shared_ptr<const LoopSolution>>;
  Pending pending() const { return solution_; }
  /// Goes on as if it had found this.
  void Resume(LoopSolution solution);

 private:
  Pending solution_;
  bool recorded_ = false;
};

}  // namespace tutti
