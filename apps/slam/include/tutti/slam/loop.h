// One proposed loop, from the detector's first suspicion to its edge in the pose graph.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tutti/backend/keyframe_graph.h"
#include "tutti/core/pose.h"
#include "tutti/loopclosure/detector.h"

#pragma GCC visibility push(default)
namespace tutti {

enum class LoopState {
  kRejected,  ///< it has no edge in the pose graph; Loop::reason says why
  kWaiting,   ///< for a second loop that agrees
  kAgreed,    ///< another correction is being solved; it enters after that one
  kDeferred,  ///< agreed, and the map fulfils it already: it enters with the next correction
  kSolving,   ///< the pose graph is being solved with it
  kInMap      ///< in the pose graph; without poses: verified
};

/// One line of loops.csv. Only proposed loops (hypothesis from loops.propose_threshold on) get one.
struct Loop {
  std::int64_t query = -1;      ///< 0-based index of the input frame
  std::int64_t candidate = -1;  ///< the same
  double query_stamp_s = 0;
  double candidate_stamp_s = 0;
  std::vector<MemberOpinion> members;
  double hypothesis = 0;   ///< of the ensemble: 1 - p(new place)
  double posterior = 0;    ///< of the ensemble at its best location
  double probability = 0;  ///< that it is a loop (LoopResult::probability), 0..1
  int matches = 0, inliers = 0;
  bool verified = false;  ///< a loop for the detector: geometry and probability
  LoopState state = LoopState::kRejected;
  bool injected = false;              ///< not the detector's (SlamSystem::AddLoop), e.g. planted as a test
  double weight = 0;                  ///< that the pose graph last gave it, 0..1; 0: never was in it,
                                      ///< or there is none (appearance only)
  std::optional<double> gate_sigmas;  ///< Mahalanobis distance from the map (run.loop_gate_sigmas), if asked
  bool revoked = false;               ///< the map contradicted it, and the detector was told
  std::optional<bool> correct;        ///< what the ground truth says of an accepted loop, if it can
  std::string reason;                 ///< why it is not accepted, in plain words
  std::string witness;                ///< what else spoke for an accepted loop: "the loop of frame 812",
                                      ///< "the map"; empty: nothing was asked for
  std::optional<Similarity> S_candidate_query;  ///< the constraint, if one could be computed

  /// In the pose graph in the end.
  bool accepted() const { return state == LoopState::kInMap; }

  LoopEdge edge;           ///< that constraint between keyframes, as corrections of the map have left it
  bool untied = false;     ///< it agreed, and landmarks do not hold its two ends together yet
  std::int64_t since = 0;  ///< numbers changes of state: loops of one state have an order
};

/// How many of them are in the map.
inline std::size_t CountAccepted(const std::vector<Loop>& loops) {
  return static_cast<std::size_t>(
      std::count_if(loops.begin(), loops.end(), [](const Loop& loop) { return loop.accepted(); }));
}

}  // namespace tutti
#pragma GCC visibility pop
