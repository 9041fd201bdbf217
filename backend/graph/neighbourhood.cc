#include "backend/graph/neighbourhood.h"

#include <limits>

namespace tutti::internal {

Neighbourhood::Neighbourhood(const GraphStructure& structure) : structure_(structure) {
  begin_.assign(structure.constant.size() + 1, 0);
  for (const EdgeEnds& ends : structure.ends) {
    ++begin_[ends.from + 1];
    ++begin_[ends.to + 1];
  }
  for (std::size_t k = 1; k < begin_.size(); ++k) begin_[k] += begin_[k - 1];
  edges_.resize(2 * structure.ends.size());
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  for (std::size_t e = 0; e < structure.ends.size(); ++e) {
    edges_[next[structure.ends[e].from]++] = e;
    edges_[next[structure.ends[e].to]++] = e;
  }
}

void Neighbourhood::Grow(const std::vector<std::size_t>& seeds, int hops, std::vector<std::size_t>& nodes,
                         std::vector<bool>& inside) const {
  std::vector<bool> seen(inside.size());
  std::vector<std::size_t> front = seeds, next;
  const auto add = [&](std::size_t node) {
    if (inside[node] || structure_.constant[node]) return;
    inside[node] = true;
    nodes.push_back(node);
  };
  for (const std::size_t seed : seeds) {
    seen[seed] = true;
    add(seed);
  }
  for (int hop = 0; hop < hops && !front.empty(); ++hop, front.swap(next)) {
    next.clear();
    for (const std::size_t node : front) {
      if (structure_.constant[node]) continue;
      ForEdges(node, [&](std::size_t e) {
        const std::size_t other = Other(e, node);
        if (seen[other]) return;
        seen[other] = true;
        add(other);
        next.push_back(other);
      });
    }
  }
}

std::vector<std::size_t> Neighbourhood::Path(std::size_t from, std::size_t to,
                                             const std::vector<bool>& without) const {
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> parent(structure_.constant.size(), kNone), queue{to};
  parent[to] = to;
  for (std::size_t head = 0; head < queue.size() && parent[from] == kNone; ++head) {
    ForEdges(queue[head], [&](std::size_t e) {
      const std::size_t other = Other(e, queue[head]);
      if (without[e] || parent[other] != kNone) return;
      parent[other] = queue[head];
      queue.push_back(other);
    });
  }
  std::vector<std::size_t> path;
  if (parent[from] == kNone) return path;
  for (std::size_t node = from; node != to; node = parent[node]) path.push_back(node);
  path.push_back(to);
  return path;
}

}  // namespace tutti::internal
