#include "tutti/backend/pose_graph.h"

#include <cmath>

#include "backend/graph/bad_information.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

std::string EdgeName(const PoseGraph& graph, const PoseGraphEdge& edge) {
  return "pose graph: edge " + graph.NameOf(edge.from) + " -> " + graph.NameOf(edge.to);
}

bool IsUsable(const Similarity& s) {
  return std::isfinite(s.scale) && s.scale > 0 && s.rotation.coeffs().allFinite() &&
         s.translation.allFinite() && s.rotation.norm() > 1e-6;
}

}  // namespace

const char* ToString(GraphKind kind) {
  switch (kind) {
    case GraphKind::kSE2:
      return "SE(2)";
    case GraphKind::kSE3:
      return "SE(3)";
    case GraphKind::kSim3:
      return "Sim(3)";
  }
  return "?";
}

std::vector<int> TangentCoordinates(GraphKind kind) {
  switch (kind) {
    case GraphKind::kSE2:
      return {0, 1, 5};
    case GraphKind::kSE3:
      return {0, 1, 2, 3, 4, 5};
    case GraphKind::kSim3:
      return {0, 1, 2, 3, 4, 5, 6};
  }
  return {};
}

Matrix7d MakeInformation(const Matrix6d& information, double log_scale) {
  Matrix7d out = Matrix7d::Zero();
  out.topLeftCorner<6, 6>() = information;
  out(6, 6) = log_scale;
  return out;
}

Matrix7d MakeInformation(double sigma_translation, double sigma_rotation, double sigma_log_scale) {
  Vector7d sigma;
  sigma << Eigen::Vector3d::Constant(sigma_translation), Eigen::Vector3d::Constant(sigma_rotation),
      sigma_log_scale;
  return sigma.array().square().inverse().matrix().asDiagonal();
}

std::string CheckInformation(const Matrix7d& information, GraphKind kind) {
  switch (internal::FaultOf(information, kind)) {
    case internal::InformationFault::kNone:
      return {};
    case internal::InformationFault::kNotFinite:
      return "its information matrix is not finite";
    case internal::InformationFault::kTooLarge:
      return "its information matrix has entries beyond 1e100; give them in 1/m^2 and 1/rad^2";
    case internal::InformationFault::kTooSmall:
      return "its information matrix has no entry above 1e-100; give them in 1/m^2 and 1/rad^2";
    case internal::InformationFault::kNotSymmetric:
      return "its information matrix is not symmetric";
    case internal::InformationFault::kNotPositiveDefinite:
      return "its information matrix is not positive definite";
  }
  return {};
}

void PoseGraph::AddNode(const PoseGraphNode& node) {
  if (!IsUsable(node.pose))
    throw InputError("pose graph: node " + NameOf(node.id) + " has a pose that is not finite");
  if (HasLandmark(node.id) || !index_.emplace(node.id, nodes_.size()).second) {
    throw InputError("pose graph: node " + NameOf(node.id) + " is there already; give each node its own id");
  }
  nodes_.push_back(node);
  nodes_.back().pose.rotation.normalize();
}

void PoseGraph::AddNode(NodeId id, const Similarity& S_world_node, bool fixed) {
  AddNode(PoseGraphNode{id, S_world_node, fixed, true});
}

void PoseGraph::AddNode(NodeId id, const Pose& T_world_node, bool fixed) {
  AddNode(id, Similarity(T_world_node), fixed);
}

void PoseGraph::AddEdge(const PoseGraphEdge& edge) {
  for (const NodeId id : {edge.from, edge.to}) {
    if (!Has(id))
      throw InputError(EdgeName(*this, edge) + ": there is no node " + NameOf(id) + "; add it first");
  }
  if (edge.from == edge.to) throw InputError(EdgeName(*this, edge) + " leads from a node to itself");
  if (!IsUsable(edge.measurement))
    throw InputError(EdgeName(*this, edge) + " has a measurement that is not finite");
  const std::string wrong = CheckInformation(edge.information, kind_);
  if (!wrong.empty()) throw InputError(EdgeName(*this, edge) + ": " + wrong);
  edges_.push_back(edge);
  edges_.back().measurement.rotation.normalize();
}

void PoseGraph::AddOdometry(NodeId from, NodeId to, const Similarity& S_from_to,
                            const Matrix7d& information) {
  AddEdge(PoseGraphEdge{from, to, S_from_to, information, EdgeKind::kOdometry});
}

void PoseGraph::AddLoop(NodeId from, NodeId to, const Similarity& S_from_to, const Matrix7d& information) {
  AddEdge(PoseGraphEdge{from, to, S_from_to, information, EdgeKind::kLoop});
}

void PoseGraph::AddLandmark(const PoseGraphLandmark& landmark) {
  const std::string name = "pose graph: landmark " + NameOf(landmark.id);
  if (kind_ == GraphKind::kSim3)
    throw InputError(name + ": a graph with scale has no landmarks; use SE(2) or SE(3)");
  if (!landmark.position.allFinite()) throw InputError(name + " has a position that is not finite");
  if (Has(landmark.id) || !landmark_index_.emplace(landmark.id, landmarks_.size()).second)
    throw InputError(name + " is there already; give each landmark and each node its own id");
  landmarks_.push_back(landmark);
}

void PoseGraph::AddMeasurement(const PoseGraphMeasurement& measurement) {
  const std::string name = "pose graph: measurement '" + measurement.line + "'";
  if (kind_ == GraphKind::kSim3)
    throw InputError(name + ": a graph with scale has neither landmarks nor priors; use SE(2) or SE(3)");
  for (const MeasurementEnd& end : {measurement.from, measurement.to}) {
    const bool missing = end.what == MeasurementEnd::What::kNode       ? !Has(end.id)
                         : end.what == MeasurementEnd::What::kLandmark ? !HasLandmark(end.id)
                                                                       : false;
    if (missing) throw InputError(name + ": there is no " + NameOf(end.id) + "; add it first");
    if (!IsUsable(end.sensor)) throw InputError(name + ": the pose of its sensor is not finite");
  }
  if (!IsUsable(measurement.value) || !std::isfinite(measurement.bearing))
    throw InputError(name + " is not finite");
  if (!internal::IsPositiveSemidefinite(measurement.information))
    throw InputError(name + ": its information matrix is not positive semidefinite");
  measurements_.push_back(measurement);
}

std::size_t PoseGraph::IndexOf(NodeId id) const {
  const auto it = index_.find(id);
  if (it == index_.end()) throw InputError("pose graph: there is no node " + NameOf(id));
  return it->second;
}

std::size_t PoseGraph::IndexOfLandmark(NodeId id) const {
  const auto it = landmark_index_.find(id);
  if (it == landmark_index_.end()) throw InputError("pose graph: there is no landmark " + NameOf(id));
  return it->second;
}

void PoseGraph::SetPose(NodeId id, const Similarity& S_world_node) {
  if (!IsUsable(S_world_node))
    throw InputError("pose graph: node " + NameOf(id) + " has a pose that is not finite");
  PoseGraphNode& node = nodes_[IndexOf(id)];
  node.pose = S_world_node;
  node.pose.rotation.normalize();
  node.has_estimate = true;
}

void PoseGraph::SetFixed(NodeId id, bool fixed) {
  (HasLandmark(id) ? landmarks_[IndexOfLandmark(id)].fixed : nodes_[IndexOf(id)].fixed) = fixed;
}

void PoseGraph::SetLandmark(NodeId id, const Eigen::Vector3d& position) {
  if (!position.allFinite())
    throw InputError("pose graph: landmark " + NameOf(id) + " has a position that is not finite");
  PoseGraphLandmark& landmark = landmarks_[IndexOfLandmark(id)];
  landmark.position = position;
  landmark.has_estimate = true;
}

std::map<NodeId, Similarity> PoseGraph::Poses() const {
  std::map<NodeId, Similarity> out;
  for (const PoseGraphNode& node : nodes_) out.emplace(node.id, node.pose);
  return out;
}

std::string PoseGraph::NameOf(NodeId id) const {
  const auto name = names_.find(id);
  return name != names_.end() ? name->second : std::to_string(id);
}

void PoseGraph::SetName(NodeId id, const std::string& name) {
  if (name != std::to_string(id)) names_.emplace(id, name);
}

}  // namespace tutti
