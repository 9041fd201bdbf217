#include "backend/graph/graph_memory.h"

#include <cstdint>
#include <utility>

namespace tutti::internal {
namespace {

bool Same(const Similarity& a, const Similarity& b) {
  return a.scale == b.scale && a.translation == b.translation && a.rotation.coeffs() == b.rotation.coeffs();
}

bool SamePlace(const PoseGraphEdge& a, const PoseGraphEdge& b) {
  return a.from == b.from && a.to == b.to && a.kind == b.kind;
}

bool Same(const PoseGraphEdge& a, const PoseGraphEdge& b) {
  return SamePlace(a, b) && Same(a.measurement, b.measurement) && a.information == b.information;
}

std::uint64_t Key(const PoseGraphEdge& edge) {
  return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(edge.from)) << 32) |
         static_cast<std::uint32_t>(edge.to);
}

}  // namespace

GraphChanges GraphMemory::Update(const PoseGraph& graph) {
  GraphChanges changes;
  std::vector<bool> touched(graph.nodes().size());
  changes.edge_before = MatchEdges(graph, touched);
  CompareNodes(graph, touched);
  for (std::size_t k = 0; k < touched.size(); ++k) {
    if (touched[k]) changes.touched.push_back(k);
  }
  nodes_ = graph.nodes();
  return changes;
}

// Edges mostly stay in place or move together, so that the next old edge is the one to compare with; the
// index of all old edges is only made when that fails.
std::vector<std::size_t> GraphMemory::MatchEdges(const PoseGraph& graph, std::vector<bool>& touched) {
  const std::vector<PoseGraphEdge>& edges = graph.edges();
  std::vector<std::size_t> before(edges.size(), GraphChanges::kNew);
  std::vector<bool> found(edges_.size());
  std::unordered_map<std::uint64_t, std::size_t> index;
  std::size_t next = 0;
  bool in_place = true;
  const auto touch = [&](const PoseGraphEdge& edge) {
    for (const int id : {edge.from, edge.to}) {
      if (graph.Has(id)) touched[graph.IndexOf(id)] = true;
    }
  };
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (next < edges_.size() && !SamePlace(edges_[next], edges[e])) {
      if (index.empty()) {
        for (std::size_t old = 0; old < edges_.size(); ++old) index.emplace(Key(edges_[old]), old);
      }
      const auto known = index.find(Key(edges[e]));
      if (known != index.end() && !found[known->second]) next = known->second;
    }
    if (next < edges_.size() && !found[next] && Same(edges_[next], edges[e])) {
      before[e] = next;
      found[next++] = true;
      in_place = in_place && before[e] == e;
    } else {
      touch(edges[e]);
      if (next < edges_.size() && SamePlace(edges_[next], edges[e])) ++next;
    }
  }
  for (std::size_t old = 0; old < found.size(); ++old) {
    if (!found[old]) touch(edges_[old]);
  }
  if (in_place && edges_.size() <= edges.size()) {
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      if (before[e] == GraphChanges::kNew) edges_[e] = edges[e];
    }
    edges_.insert(edges_.end(), edges.begin() + static_cast<std::ptrdiff_t>(edges_.size()), edges.end());
  } else {
    edges_ = edges;
  }
  return before;
}

void GraphMemory::CompareNodes(const PoseGraph& graph, std::vector<bool>& touched) const {
  std::unordered_map<int, std::size_t> index;
  for (std::size_t k = 0; k < touched.size(); ++k) {
    const PoseGraphNode& node = graph.nodes()[k];
    const PoseGraphNode* old = k < nodes_.size() && nodes_[k].id == node.id ? &nodes_[k] : nullptr;
    if (old == nullptr && k < nodes_.size()) {
      if (index.empty()) {
        for (std::size_t o = 0; o < nodes_.size(); ++o) index.emplace(nodes_[o].id, o);
      }
      const auto known = index.find(node.id);
      if (known != index.end()) old = &nodes_[known->second];
    }
    if (old == nullptr || old->fixed != node.fixed || !Same(old->pose, node.pose)) touched[k] = true;
  }
}

}  // namespace tutti::internal
