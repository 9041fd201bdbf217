// The pose graph of the odometry's keyframes, kept over several corrections.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "apps/slam/loop_gate.h"
#include "tutti/backend/online_optimizer.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/loop_record.h"
#include "tutti/slam/slam_options.h"

namespace tutti {

/// Nodes are keyframes; edges are consecutive keyframes, pairs that share many landmarks, and loops.
///
/// An odometry edge is measured from the map as it is, until a correction moves its two keyframes: from then
/// on the old measurement stays, since the corrected poses no longer say what the odometry saw. Mono: a
/// correction also rescales each keyframe's surroundings, so measurements are carried over to the new units
/// (S' = scale(s_a) S scale(1/s_b) for nodes a, b with corrected scales s_a, s_b).
class MapGraph {
 public:
  MapGraph(const PoseGraphOptions& solver, const OnlineOptions& online, const SlamOptions& options,
           Sensor sensor);

  /// To be called for each new keyframe: remembers which map piece it began in.
  void AddKeyframe(int id, int piece) { birth_piece_[id] = piece; }

  /// The graph of the present map with these loops; poses as they are in the map. Pieces that loops join are
  /// moved into the frame of the older one.
  PoseGraph Build(const Odometry& odometry, const std::vector<LoopEdge>& loops) const;

  struct Correction {
    bool success = false;
    std::string reason;                          ///< why not
    std::map<int, Similarity> S_world_keyframe;  ///< of all keyframes
    std::map<int, int> merges;                   ///< map piece -> the piece that it joined
    std::vector<Disagreement> residuals;         ///< of each loop after the optimisation
    std::vector<double> weights;                 ///< of each loop, from the robust loss
  };
  /// Optimises the graph with these loops, as far as they and what else changed since the last call reach
  /// (OnlineOptimizer; all of it with Ceres). The odometry is not touched.
  Correction Optimize(const Odometry& odometry, const std::vector<LoopEdge>& loops);

  /// Mahalanobis distance [1] of each entering loop from what the graph with the accepted ones knows of its
  /// relative pose; nothing where no edges connect its ends.
  std::vector<std::optional<double>> Distances(const Odometry& odometry,
                                               const std::vector<LoopEdge>& accepted,
                                               const std::vector<LoopEdge>& entering) const;

  /// To be called before the correction is applied to the odometry: keeps the measurements, and carries them
  /// and the loops over to the corrected units.
  void Keep(const Odometry& odometry, const Correction& correction, std::vector<LoopEdge>& accepted,
            std::vector<LoopEdge>& waiting);

  /// To be called after the odometry has adjusted its whole map, loops included: from now on the map as it is
  /// says more than what was measured before. Loops that it contradicts keep their measurement.
  void MeasureAgain(const Odometry& odometry, std::vector<LoopEdge>& accepted);

 private:
  using Edge = std::pair<int, int>;  // older, newer keyframe id
  /// Odometry edges with their measurements, in order.
  std::map<Edge, Similarity> OdometryEdges(const Odometry& odometry) const;
  Matrix7d OdometryInformation(const Similarity& measurement, double depth) const;
  std::map<int, int> Merges(const Odometry& odometry, const std::vector<LoopEdge>& loops) const;

  OnlineOptimizer optimizer_;
  SlamOptions options_;
  GraphKind kind_;
  std::map<int, int> birth_piece_;
  std::map<Edge, Similarity> kept_;  // measurements from before the last correction, in present units
};

}  // namespace tutti
