// Which nodes follow each other?
#include <algorithm>
#include <cctype>
#include <numeric>

#include "backend/graph/graph_structure.h"

namespace tutti {
namespace internal {
namespace {

/// A letter of ASCII, with which programs name a robot or a kind of variable.
bool IsLetter(std::int64_t byte) { return byte < 128 && std::isalpha(static_cast<int>(byte)) != 0; }

/// Blocks of sorted ids: where each id's block begins is 1 in `begins`.
using Begins = std::vector<char>;

/// Letters in the highest byte of 64 bits (gtsam::Symbol), in the next one as well (gtsam::LabeledSymbol), or
/// in the highest of 32 bits, if all ids have one.
Begins LettersOf(const std::vector<NodeId>& ids) {
  const bool small = std::all_of(ids.begin(), ids.end(),
                                 [](NodeId id) { return id >= 0 && id >> 32 == 0 && IsLetter(id >> 24); });
  const auto letters = [small](NodeId id) -> std::int64_t {
    if (small) return id >> 24;
    if (id < 0 || !IsLetter(id >> 56)) return 0;
    return IsLetter(id >> 48 & 0xff) ? id >> 48 : id >> 56 << 8;
  };
  Begins out(ids.size(), 0);
  for (std::size_t k = 1; k < ids.size(); ++k) out[k] = letters(ids[k]) != letters(ids[k - 1]) ? 1 : 0;
  return out;
}

/// Whether ids are numbered as block * base + index: each block begins with the index 0 or 1, has several
/// ids, and is much farther from the one before than ids within a block are from each other.
bool InBlocksOf(std::int64_t base, const std::vector<NodeId>& ids, Begins* begins) {
  constexpr std::int64_t kFarther = 10;
  Begins out(ids.size(), 0);
  std::int64_t within = 0, between = ids.back();
  std::size_t first = 0;
  if (ids.front() % base > 1) return false;
  for (std::size_t k = 1; k <= ids.size(); ++k) {
    const bool ends = k == ids.size() || ids[k] / base != ids[k - 1] / base;
    if (!ends) {
      within = std::max(within, ids[k] - ids[k - 1]);
      continue;
    }
    if (k - first < 2) return false;
    first = k;
    if (k == ids.size()) break;
    if (ids[k] % base > 1) return false;
    between = std::min(between, ids[k] - ids[k - 1]);
    out[k] = 1;
  }
  if (between / kFarther < within) return false;
  *begins = std::move(out);
  return true;
}

Begins BlocksOf(const std::vector<NodeId>& ids) {
  Begins begins = LettersOf(ids);
  const bool letters = std::count(begins.begin(), begins.end(), 1) > 0;
  if (letters || ids.empty() || ids.front() < 0) return begins;
  std::vector<std::int64_t> bases;
  for (std::int64_t base = 1000; base <= ids.back() && base < 1000000000000000000; base *= 10)
    bases.push_back(base);
  for (int bits = 8; bits < 62 && std::int64_t{1} << bits <= ids.back(); ++bits)
    bases.push_back(std::int64_t{1} << bits);
  std::sort(bases.rbegin(), bases.rend());
  for (const std::int64_t base : bases) {
    if (ids.front() / base != ids.back() / base && InBlocksOf(base, ids, &begins)) break;
  }
  return begins;
}

}  // namespace

NodeOrder OrderOf(const PoseGraph& graph) {
  const std::vector<PoseGraphNode>& nodes = graph.nodes();
  std::vector<std::size_t> sorted(nodes.size());
  std::iota(sorted.begin(), sorted.end(), std::size_t{0});
  std::sort(sorted.begin(), sorted.end(),
            [&](std::size_t a, std::size_t b) { return nodes[a].id < nodes[b].id; });
  std::vector<NodeId> ids;
  ids.reserve(nodes.size());
  for (const std::size_t k : sorted) ids.push_back(nodes[k].id);
  const Begins begins = BlocksOf(ids);
  NodeOrder out;
  out.place.resize(nodes.size());
  out.robot.resize(nodes.size());
  std::size_t robot = 0;
  for (std::size_t k = 0; k < sorted.size(); ++k) {
    robot += begins[k] == 1 ? 1 : 0;
    out.place[sorted[k]] = k;
    out.robot[sorted[k]] = robot;
  }
  return out;
}

}  // namespace internal

void PoseGraph::FindOdometry() {
  const internal::NodeOrder order = internal::OrderOf(*this);
  for (PoseGraphEdge& edge : edges_) {
    if (!edge.kind_by_ids) continue;
    const std::size_t i = IndexOf(edge.from), j = IndexOf(edge.to);
    const auto [low, high] = std::minmax(order.place[i], order.place[j]);
    const bool neighbours = high == low + 1 && order.robot[i] == order.robot[j];
    edge.kind = neighbours ? EdgeKind::kOdometry : EdgeKind::kLoop;
  }
}

}  // namespace tutti
