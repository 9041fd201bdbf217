// A pose graph of keyframes, made easy: what a SLAM pipeline needs after each accepted loop.
//
//   KeyframeGraphOptions options;  options.kind = GraphKind::kSim3;                      // mono
//   KeyframeGraph graph(options);
//   for (each keyframe) graph.AddKeyframe(id, Similarity(T_world_keyframe), map_piece);  // in order of time
//   graph.AddCovisibility(a, b);                                                         // optional
//   graph.AddLoop(older, newer, S_older_newer, information);
//   const KeyframeCorrection correction = graph.Optimize();
//   odometry.ApplyCorrection(correction.S_world_keyframe);
#pragma once

#include <map>
#include <string>
#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {

struct KeyframeGraphOptions {
  GraphKind kind = GraphKind::kSE3;        ///< kSE3: stereo, RGB-D; kSim3: mono
  PoseGraphOptions solver;                 ///< init should stay kFile: the odometry is the start
  double sigma_translation_ratio = 0.02;   ///< odometry error as a fraction of the distance moved [1]
  double sigma_translation_floor = 0.005;  ///< and at least this [m]
  double sigma_rotation_rad = 0.005;       ///< odometry's rotation error per edge [rad]
  double sigma_log_scale = 0.01;           ///< mono: drift of log scale per edge [1]
  KeyframeGraphOptions();
  std::string Validate() const;
};

/// What became of one loop.
struct LoopOutcome {
  int from = 0, to = 0;
  double chi2_before = 0;      ///< at the odometry's poses
  double chi2 = 0;             ///< after optimisation
  double weight = 1;           ///< the robust loss' final weight
  bool down_weighted = false;  ///< weight < 0.5: not believed
};

struct KeyframeCorrection {
  bool success = false;
  std::string reason;                          ///< why not
  std::map<int, Similarity> S_world_keyframe;  ///< corrected poses of every keyframe (scale 1 unless kSim3)
  std::vector<LoopOutcome> loops;              ///< in the order in which the loops were added
  std::map<int, int> merges;  ///< map pieces that loops joined: piece -> smallest piece of its group
  PoseGraphReport report;
};

class KeyframeGraph {
 public:
  /// Throws InputError if the options are not usable.
  explicit KeyframeGraph(const KeyframeGraphOptions& options = {});

  /// Adds a keyframe at its present pose. A keyframe of the same map piece as the one before gets an odometry
  /// edge from it, measured from the two present poses (S_prev_world * S_world_this). The first keyframe is
  /// the anchor.
  void AddKeyframe(int id, const Similarity& S_world_keyframe, int map_piece = 0);
  /// Adds an odometry edge between two keyframes that see the same landmarks, measured from their present
  /// poses. `confidence` scales its information (1: like an odometry edge).
  void AddCovisibility(int older, int newer, double confidence = 1.0);
  /// Odometry measured at an earlier time, e.g. kept from before a correction.
  void AddOdometry(int from, int to, const Similarity& S_from_to, const Matrix7d& information);
  /// Adds a verified loop: S_from_to maps points of keyframe `to` into keyframe `from`; 6x6 of (translation,
  /// rotation).
  void AddLoop(int from, int to, const Similarity& S_from_to, const Matrix6d& information,
               double sigma_log_scale = 0.05);

  /// Optimises a copy of the graph; the graph itself keeps its poses, so that loops can be added and the call
  /// repeated.
  KeyframeCorrection Optimize() const;

  const PoseGraph& graph() const { return graph_; }
  /// The default odometry information for a relative pose.
  Matrix7d OdometryInformation(const Similarity& S_from_to) const;

 private:
  KeyframeGraphOptions options_;
  PoseGraph graph_;
  std::map<int, int> piece_;
  int last_id_ = -1;
};

}  // namespace tutti
