#include "tutti/backend/pose_graph.h"

#include <cmath>

#include "backend/graph/bad_information.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

std::string EdgeName(const PoseGraphEdge& edge) {
  return "edge " + std::to_string(edge.from) + " -> " + std::to_string(edge.to);
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
  if (!IsUsable(node.pose)) {
    throw InputError("pose graph: node " + std::to_string(node.id) + " has a pose that is not finite");
  }
  if (!index_.emplace(node.id, nodes_.size()).second) {
    throw InputError("pose graph: node " + std::to_string(node.id) +
                     " is there already; give each node its own id");
  }
  nodes_.push_back(node);
  nodes_.back().pose.rotation.normalize();
}

void PoseGraph::AddNode(int id, const Similarity& S_world_node, bool fixed) {
  AddNode(PoseGraphNode{id, S_world_node, fixed, true});
}

void PoseGraph::AddNode(int id, const Pose& T_world_node, bool fixed) {
  AddNode(id, Similarity(T_world_node), fixed);
}

void PoseGraph::AddEdge(const PoseGraphEdge& edge) {
  for (int id : {edge.from, edge.to}) {
    if (!Has(id)) {
      throw InputError("pose graph: " + EdgeName(edge) + ": there is no node " + std::to_string(id) +
                       "; add it first");
    }
  }
  if (edge.from == edge.to)
    throw InputError("pose graph: " + EdgeName(edge) + " leads from a node to itself");
  if (!IsUsable(edge.measurement)) {
    throw InputError("pose graph: " + EdgeName(edge) + " has a measurement that is not finite");
  }
  const std::string wrong = CheckInformation(edge.information, kind_);
  if (!wrong.empty()) throw InputError("pose graph: " + EdgeName(edge) + ": " + wrong);
  edges_.push_back(edge);
  edges_.back().measurement.rotation.normalize();
}

void PoseGraph::AddOdometry(int from, int to, const Similarity& S_from_to, const Matrix7d& information) {
  AddEdge(PoseGraphEdge{from, to, S_from_to, information, EdgeKind::kOdometry});
}

void PoseGraph::AddLoop(int from, int to, const Similarity& S_from_to, const Matrix7d& information) {
  AddEdge(PoseGraphEdge{from, to, S_from_to, information, EdgeKind::kLoop});
}

std::size_t PoseGraph::IndexOf(int id) const {
  const auto it = index_.find(id);
  if (it == index_.end()) throw InputError("pose graph: there is no node " + std::to_string(id));
  return it->second;
}

void PoseGraph::SetPose(int id, const Similarity& S_world_node) {
  if (!IsUsable(S_world_node)) {
    throw InputError("pose graph: node " + std::to_string(id) + " has a pose that is not finite");
  }
  PoseGraphNode& node = nodes_[IndexOf(id)];
  node.pose = S_world_node;
  node.pose.rotation.normalize();
  node.has_estimate = true;
}

void PoseGraph::SetFixed(int id, bool fixed) { nodes_[IndexOf(id)].fixed = fixed; }

std::map<int, Similarity> PoseGraph::Poses() const {
  std::map<int, Similarity> out;
  for (const PoseGraphNode& node : nodes_) out.emplace(node.id, node.pose);
  return out;
}

}  // namespace tutti
