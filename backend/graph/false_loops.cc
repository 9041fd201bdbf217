#include "backend/graph/false_loops.h"

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <string>

#include "backend/graph/graph_structure.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

/// Draws for one graph. No std distributions: their numbers differ between standard libraries.
class Planter {
 public:
  Planter(PoseGraph& graph, const FalseLoopOptions& options)
      : graph_(graph),
        options_(options),
        random_(options.seed),
        diagonal_(BoundingBoxDiagonal(graph)),
        component_of_(internal::AnalyseGraph(graph).component_of) {
    for (std::size_t e = 0; e < graph.edges().size(); ++e) {
      if (graph.edges()[e].kind == EdgeKind::kLoop) templates_.push_back(e);
    }
    if (templates_.empty()) templates_.push_back(0);
  }

  std::vector<std::size_t> Plant() {
    std::vector<std::size_t> planted;
    const std::size_t count = static_cast<std::size_t>(options_.count);
    while (planted.size() < count) {
      const std::size_t size =
          std::min(static_cast<std::size_t>(options_.cluster_size), count - planted.size());
      if (!PlantCluster(size, planted)) {
        throw InputError("false loops: no place for " + std::to_string(size) +
                         " of them that contradict the graph; plant fewer or lower min_gap and min_error");
      }
    }
    return planted;
  }

 private:
  double Uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  double Symmetric(double limit) { return limit * (2 * Uniform() - 1); }
  // z is drawn first: in the arguments of one call, which comes first would be the compiler's choice.
  Eigen::Vector3d Vector(double limit) {
    const double z = Symmetric(limit), y = Symmetric(limit), x = Symmetric(limit);
    return {x, y, z};
  }
  std::size_t Index(std::size_t size) { return static_cast<std::size_t>(random_() % size); }
  const Similarity& PoseAt(std::size_t node) const { return graph_.nodes()[node].pose; }

  /// A relative pose of at most these lengths and angles; flat in the plane.
  Similarity Draw(double length, double angle) {
    Eigen::Vector3d t = Vector(length);
    Eigen::Vector3d r = Vector(angle);
    if (graph_.kind() == GraphKind::kSE2) {
      t.z() = 0;
      r.x() = r.y() = 0;
    }
    return Similarity(1.0, ExpSO3(r), t);
  }

  Similarity DrawMeasurement(std::size_t number, const PoseGraphEdge& like) {
    constexpr FalseLoopKind kTurns[] = {FalseLoopKind::kAnywhere, FalseLoopKind::kTrueMeasurement,
                                        FalseLoopKind::kSamePlace};
    const FalseLoopKind kind = options_.kind == FalseLoopKind::kInTurn ? kTurns[number % 3] : options_.kind;
    if (kind == FalseLoopKind::kAnywhere) return Draw(0.3 * diagonal_, M_PI / std::sqrt(3.0));
    if (kind == FalseLoopKind::kTrueMeasurement) return like.measurement;
    return Draw(0.3, 0.2);
  }

  /// False after many draws without one that contradicts the graph.
  bool PlantCluster(std::size_t size, std::vector<std::size_t>& planted) {
    constexpr int kTries = 10000;
    const std::size_t nodes = graph_.nodes().size(), gap = static_cast<std::size_t>(options_.min_gap);
    if (options_.newest >= 0 && graph_.IndexOf(options_.newest) + 1 < size) return false;
    for (int k = 0; k < kTries; ++k) {
      const std::size_t i = Index(nodes), drawn = Index(nodes);
      const std::size_t j = options_.newest < 0 ? drawn : graph_.IndexOf(options_.newest) + 1 - size;
      const PoseGraphEdge like = graph_.edges()[templates_[Index(templates_.size())]];
      const Similarity first = DrawMeasurement(planted.size() / size, like);
      if ((i > j ? i - j : j - i) < gap + size || i + size > nodes || j + size > nodes) continue;
      if (component_of_[i] != component_of_[j]) continue;
      const Similarity error = first.Inverse() * PoseAt(i).Inverse() * PoseAt(j);
      if (error.translation.norm() < options_.min_error * diagonal_) continue;
      for (std::size_t s = 0; s < size; ++s) {
        PoseGraphEdge edge = like;
        edge.kind = EdgeKind::kLoop;
        edge.from = graph_.nodes()[i + s].id;
        edge.to = graph_.nodes()[j + s].id;
        edge.measurement = PoseAt(i + s).Inverse() * PoseAt(i) * first * PoseAt(j).Inverse() * PoseAt(j + s);
        planted.push_back(graph_.edges().size());
        graph_.AddEdge(edge);
      }
      return true;
    }
    return false;
  }

  PoseGraph& graph_;
  const FalseLoopOptions& options_;
  std::mt19937_64 random_;
  double diagonal_;
  std::vector<std::size_t> component_of_;
  std::vector<std::size_t> templates_;  // edges whose information the planted ones take
};

}  // namespace

std::string FalseLoopOptions::Validate() const {
  if (count < 0) return "false loops: count must not be negative";
  if (cluster_size < 1) return "false loops: cluster_size must be at least 1";
  if (min_gap < 1) return "false loops: min_gap must be at least 1";
  if (!(min_error > 0 && min_error < 1)) return "false loops: min_error must be in (0, 1)";
  return {};
}

std::vector<std::size_t> PlantFalseLoops(PoseGraph& graph, const FalseLoopOptions& options) {
  const std::string wrong = options.Validate();
  if (!wrong.empty()) throw InputError(wrong);
  if (options.count == 0) return {};
  if (graph.edges().empty()) throw InputError("false loops: the graph has no edge to learn from");
  return Planter(graph, options).Plant();
}

double BoundingBoxDiagonal(const PoseGraph& graph) {
  Eigen::AlignedBox3d box;
  for (const PoseGraphNode& node : graph.nodes()) box.extend(node.pose.translation);
  return box.isEmpty() ? 0.0 : box.diagonal().norm();
}

}  // namespace tutti
