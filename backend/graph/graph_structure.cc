#include "backend/graph/graph_structure.h"

#include <limits>
#include <numeric>

namespace tutti::internal {
namespace {

/// Nodes, and behind them landmarks, that edges and measurements join.
class Parts {
 public:
  Parts(const PoseGraph& graph, const std::vector<EdgeEnds>& ends)
      : graph_(graph), parent_(graph.nodes().size() + graph.landmarks().size()) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    for (const auto& [from, to] : ends) parent_[Root(from)] = Root(to);
    for (const PoseGraphMeasurement& m : graph.measurements()) {
      if (m.from.what != MeasurementEnd::What::kWorld) parent_[Root(PlaceOf(m.from))] = Root(PlaceOf(m.to));
    }
  }

  std::size_t Root(std::size_t k) { return RootOf(parent_, k); }
  std::size_t PlaceOf(const MeasurementEnd& end) const {
    return end.what == MeasurementEnd::What::kNode ? graph_.IndexOf(end.id)
                                                   : graph_.nodes().size() + graph_.IndexOfLandmark(end.id);
  }
  std::size_t size() const { return parent_.size(); }

 private:
  const PoseGraph& graph_;
  std::vector<std::size_t> parent_;
};

}  // namespace

std::size_t RootOf(std::vector<std::size_t>& parent, std::size_t k) {
  while (parent[k] != k) k = parent[k] = parent[parent[k]];
  return k;
}

GraphStructure AnalyseGraph(const PoseGraph& graph) {
  const auto& nodes = graph.nodes();
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  GraphStructure out;
  out.ends.reserve(graph.edges().size());
  for (const PoseGraphEdge& edge : graph.edges())
    out.ends.push_back({graph.IndexOf(edge.from), graph.IndexOf(edge.to)});
  Parts parts(graph, out.ends);
  std::vector<std::size_t> component_of_root(parts.size(), kNone);
  out.constant.assign(nodes.size(), false);
  out.component_of.resize(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    std::size_t& component = component_of_root[parts.Root(i)];
    if (component == kNone) {
      component = out.components.size();
      out.components.push_back({nodes[i].id, 0});
      out.anchor.push_back(i);
    }
    out.component_of[i] = component;
    ++out.components[component].nodes;
    if (nodes[i].fixed) out.constant[i] = true;
    // The anchor: the first fixed node, else the node of the smallest id.
    std::size_t& anchor = out.anchor[component];
    const bool better =
        nodes[i].fixed ? !nodes[anchor].fixed : (!nodes[anchor].fixed && nodes[i].id < nodes[anchor].id);
    if (better) anchor = i;
  }
  for (std::size_t c = 0; c < out.components.size(); ++c) {
    out.constant[out.anchor[c]] = true;
    out.components[c].anchor = nodes[out.anchor[c]].id;
  }
  const auto hold = [&](std::size_t k) {
    const std::size_t component = component_of_root[parts.Root(k)];
    if (component != kNone && !nodes[out.anchor[component]].fixed) out.components[component].by_priors = true;
  };
  for (const PoseGraphMeasurement& m : graph.measurements()) {
    if (m.from.what == MeasurementEnd::What::kWorld && !m.information.isZero(0)) hold(parts.PlaceOf(m.to));
  }
  for (std::size_t k = 0; k < graph.landmarks().size(); ++k) {
    if (graph.landmarks()[k].fixed) hold(nodes.size() + k);
  }
  return out;
}

GraphStructure HeldByPriors(GraphStructure structure, const PoseGraph& graph) {
  for (std::size_t c = 0; c < structure.components.size(); ++c) {
    const std::size_t anchor = structure.anchor[c];
    if (structure.components[c].by_priors) structure.constant[anchor] = graph.nodes()[anchor].fixed;
  }
  return structure;
}

std::vector<int> NumberUnknowns(const std::vector<bool>& constant, int& count) {
  std::vector<int> out;
  count = 0;
  for (const bool held : constant) out.push_back(held ? -1 : count++);
  return out;
}

}  // namespace tutti::internal
