// Pose graph: nodes (poses in the world) and edges (relative poses with information matrices).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "tutti/core/pose.h"

#pragma GCC visibility push(default)
namespace tutti {

/// What a node is: planar pose (x, y, heading about z), rigid pose, or similarity (mono: the scale drifts
/// too).
enum class GraphKind { kSE2, kSE3, kSim3 };
const char* ToString(GraphKind kind);

/// kOdometry edges are trusted; robust losses act on kLoop edges only.
enum class EdgeKind { kOdometry, kLoop };

/// One pose of the graph.
struct PoseGraphNode {
  int id = 0;
  Similarity pose;           ///< S_world_node (scale 1 unless the graph is kSim3)
  bool fixed = false;        ///< held where it is
  bool has_estimate = true;  ///< false: the pose is unknown and must be initialised from the edges
};

/// One measurement: S_from_to maps points of `to` into `from`.
/// The information (inverse covariance) is 7x7 in the order (translation [1/m^2], rotation [1/rad^2], log
/// scale); kSE3 uses its top-left 6x6, kSE2 its rows and columns 0, 1 (x, y) and 5 (heading). The objective
/// says what "rotation" is: kChi2Log the rotation vector, kChi2 the vector part of the quaternion (half of
/// it; what g2o files mean).
struct PoseGraphEdge {
  int from = 0;
  int to = 0;
  Similarity measurement;  ///< S_from_to
  Matrix7d information = Matrix7d::Identity();
  EdgeKind kind = EdgeKind::kOdometry;
};

/// Indices of the 7 tangent coordinates that a graph of this kind uses: 3, 6 or 7 of them.
std::vector<int> TangentCoordinates(GraphKind kind);

/// A 6x6 information of (translation, rotation) as the top-left of a 7x7 one; `log_scale` goes into its last
/// place.
Matrix7d MakeInformation(const Matrix6d& information, double log_scale = 1.0);

/// Diagonal information from standard deviations [m], [rad] and of the log scale [1].
Matrix7d MakeInformation(double sigma_translation, double sigma_rotation, double sigma_log_scale = 1.0);

/// A value type. Nodes and edges keep the order in which they were added.
class PoseGraph {
 public:
  explicit PoseGraph(GraphKind kind = GraphKind::kSE3) : kind_(kind) {}

  /// Throws InputError if the id is there already or the pose is not finite.
  void AddNode(const PoseGraphNode& node);
  void AddNode(int id, const Similarity& S_world_node, bool fixed = false);
  void AddNode(int id, const Pose& T_world_node, bool fixed = false);

  /// Throws InputError if a node is missing, both ends are the same, the measurement is not finite or its
  /// scale not positive, or the information is not symmetric positive definite.
  void AddEdge(const PoseGraphEdge& edge);
  void AddOdometry(int from, int to, const Similarity& S_from_to, const Matrix7d& information);
  void AddLoop(int from, int to, const Similarity& S_from_to, const Matrix7d& information);

  GraphKind kind() const { return kind_; }
  const std::vector<PoseGraphNode>& nodes() const { return nodes_; }
  const std::vector<PoseGraphEdge>& edges() const { return edges_; }
  bool Has(int id) const { return index_.count(id) != 0; }
  /// Position of a node in nodes(). Throws InputError if there is no such id.
  std::size_t IndexOf(int id) const;
  const PoseGraphNode& Node(int id) const { return nodes_[IndexOf(id)]; }
  void SetPose(int id, const Similarity& S_world_node);
  void SetFixed(int id, bool fixed);
  /// S_world_node of every node, by id.
  std::map<int, Similarity> Poses() const;

 private:
  friend class PoseGraphOptimizer;
  GraphKind kind_;
  std::vector<PoseGraphNode> nodes_;
  std::vector<PoseGraphEdge> edges_;
  std::unordered_map<int, std::size_t> index_;
};

/// Empty if the information is symmetric and positive definite in the coordinates of this kind, else what is
/// wrong.
std::string CheckInformation(const Matrix7d& information, GraphKind kind);

}  // namespace tutti
#pragma GCC visibility pop
