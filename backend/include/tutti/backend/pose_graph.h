// Pose graph: nodes (poses in the world) and edges (relative poses with information matrices); where a file
// has them, landmarks, their measurements, and priors.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
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

/// Id of a node or a landmark. Ids of 2^63 and more, which g2o files may have, are negative here and keep
/// their spelling (PoseGraph::NameOf).
using NodeId = std::int64_t;

/// One pose of the graph.
struct PoseGraphNode {
  NodeId id = 0;
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
  NodeId from = 0;
  NodeId to = 0;
  Similarity measurement;  ///< S_from_to
  Matrix7d information = Matrix7d::Identity();
  EdgeKind kind = EdgeKind::kOdometry;
  bool kind_by_ids = false;  ///< `kind` is what PoseGraph::FindOdometry makes it
};

/// A point of the world that is no node.
struct PoseGraphLandmark {
  NodeId id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< [m]; in a kSE2 graph z is 0
  bool fixed = false;                                  ///< held where it is
  bool has_estimate = true;                            ///< false: unknown, to be placed by its measurements
};

/// What one end of a measurement is: the world itself (a prior), a node with a sensor on it, or a landmark.
struct MeasurementEnd {
  enum class What { kWorld, kNode, kLandmark };
  What what = What::kWorld;
  NodeId id = 0;
  Similarity sensor;  ///< S_node_sensor, of a node
};

/// A measurement that is no edge between two nodes: of a landmark, or a prior. It is trusted as odometry is.
/// With S the relative pose of the two ends (a landmark has no rotation), kPose measures S, kPosition its
/// translation, kBearing the direction atan2(y, x) of the translation (kSE2).
struct PoseGraphMeasurement {
  enum class What { kPose, kPosition, kBearing };
  What what = What::kPosition;
  MeasurementEnd from, to;
  Similarity value;    ///< kPose, kPosition
  double bearing = 0;  ///< kBearing [rad]
  /// Positive semidefinite, in the coordinates of PoseGraphEdge::information: kPosition those of the
  /// translation alone, kBearing (0, 0).
  Matrix7d information = Matrix7d::Zero();
  std::string line;  ///< what WriteG2o writes for it
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
  void AddNode(NodeId id, const Similarity& S_world_node, bool fixed = false);
  void AddNode(NodeId id, const Pose& T_world_node, bool fixed = false);

  /// Throws InputError if a node is missing, both ends are the same, the measurement is not finite or its
  /// scale not positive, or the information is not symmetric positive definite.
  void AddEdge(const PoseGraphEdge& edge);
  void AddOdometry(NodeId from, NodeId to, const Similarity& S_from_to, const Matrix7d& information);
  void AddLoop(NodeId from, NodeId to, const Similarity& S_from_to, const Matrix7d& information);

  /// Throws InputError if a node or landmark has the id already, the position is not finite, or the graph is
  /// kSim3.
  void AddLandmark(const PoseGraphLandmark& landmark);
  /// Throws InputError if an end is missing, a number is not finite, the information is not positive
  /// semidefinite, or the graph is kSim3.
  void AddMeasurement(const PoseGraphMeasurement& measurement);

  /// Decides the kind of the edges with `kind_by_ids`: odometry joins nodes whose ids are neighbours among
  /// those of the graph, everything else is a loop. Ids of several robots are told apart by the letter in
  /// their highest byte (symbols of GTSAM; with a second letter in the next byte, too) or where blocks begin
  /// at multiples of a power of 10 or 2, far from the end of the block before. Neighbours are of one robot.
  void FindOdometry();

  GraphKind kind() const { return kind_; }
  const std::vector<PoseGraphNode>& nodes() const { return nodes_; }
  const std::vector<PoseGraphEdge>& edges() const { return edges_; }
  const std::vector<PoseGraphLandmark>& landmarks() const { return landmarks_; }
  const std::vector<PoseGraphMeasurement>& measurements() const { return measurements_; }
  bool Has(NodeId id) const { return index_.count(id) != 0; }
  /// Position of a node in nodes(). Throws InputError if there is no such id.
  std::size_t IndexOf(NodeId id) const;
  /// Position of a landmark in landmarks(). Throws InputError if there is no such id.
  std::size_t IndexOfLandmark(NodeId id) const;
  bool HasLandmark(NodeId id) const { return landmark_index_.count(id) != 0; }
  const PoseGraphNode& Node(NodeId id) const { return nodes_[IndexOf(id)]; }
  void SetPose(NodeId id, const Similarity& S_world_node);
  void SetFixed(NodeId id, bool fixed);
  /// Moves a landmark. Throws InputError if there is no such id or the position is not finite.
  void SetLandmark(NodeId id, const Eigen::Vector3d& position);
  /// S_world_node of every node, by id.
  std::map<NodeId, Similarity> Poses() const;

  /// How an id is written: as SetName has it ("007", or 9223372036854775808, which NodeId holds as a negative
  /// number), else its decimal digits.
  std::string NameOf(NodeId id) const;
  void SetName(NodeId id, const std::string& name);
  /// Lines that WriteG2o puts first: parameters that measurements refer to.
  std::vector<std::string> parameter_lines;

 private:
  friend class PoseGraphOptimizer;
  GraphKind kind_;
  std::vector<PoseGraphNode> nodes_;
  std::vector<PoseGraphEdge> edges_;
  std::vector<PoseGraphLandmark> landmarks_;
  std::vector<PoseGraphMeasurement> measurements_;
  std::unordered_map<NodeId, std::size_t> index_, landmark_index_;
  std::unordered_map<NodeId, std::string> names_;  // of the ids that are not written as usual
};

/// Empty if the information is symmetric and positive definite in the coordinates of this kind, else what is
/// wrong.
std::string CheckInformation(const Matrix7d& information, GraphKind kind);

}  // namespace tutti
#pragma GCC visibility pop
