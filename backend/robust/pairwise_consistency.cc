#include "backend/robust/pairwise_consistency.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

#include "backend/robust/loop_agreement.h"

namespace tutti::internal {
namespace {

/// Rows of bits.
class BitMatrix {
 public:
  explicit BitMatrix(std::size_t size) : words_((size + 63) / 64), bits_(size * words_, 0) {}
  void Set(std::size_t r, std::size_t c) { bits_[r * words_ + c / 64] |= std::uint64_t{1} << (c % 64); }
  bool Get(std::size_t r, std::size_t c) const { return (bits_[r * words_ + c / 64] >> (c % 64) & 1) != 0; }

 private:
  std::size_t words_;
  std::vector<std::uint64_t> bits_;
};

/// A large clique: from each of the best-connected vertices, those that agree with all taken so far.
std::vector<std::size_t> LargeClique(const BitMatrix& agrees, const std::vector<std::size_t>& degree) {
  constexpr std::size_t kStarts = 50;
  std::vector<std::size_t> order(degree.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return degree[a] > degree[b]; });
  std::vector<std::size_t> best;
  for (std::size_t start = 0; start < std::min(kStarts, order.size()); ++start) {
    std::vector<std::size_t> clique = {order[start]};
    for (const std::size_t v : order) {
      const bool fits = v != order[start] && std::all_of(clique.begin(), clique.end(),
                                                         [&](std::size_t u) { return agrees.Get(v, u); });
      if (fits) clique.push_back(v);
    }
    if (clique.size() > best.size()) best = std::move(clique);
  }
  return best;
}

}  // namespace

std::vector<bool> PairwiseConsistentEdges(const PoseGraph& graph, const GraphStructure& structure,
                                          GraphObjective objective, double threshold) {
  const LoopAgreement agreement(graph, structure, objective);
  const std::vector<MeasuredLoop>& loops = agreement.loops();
  std::vector<bool> keep(graph.edges().size(), true);
  for (const MeasuredLoop& loop : loops) keep[loop.edge] = false;
  const auto agree = [&](const MeasuredLoop& a, const MeasuredLoop& b) {
    return !agreement.HasOdometry(a.from, b.from) || !agreement.HasOdometry(a.to, b.to) ||
           agreement.CycleChi2(a, b) <= threshold;
  };
  BitMatrix agrees(loops.size());
  std::vector<std::size_t> degree(loops.size(), 0);
  for (std::size_t a = 0; a < loops.size(); ++a) {
    for (std::size_t b = a + 1; b < loops.size(); ++b) {
      if (!agree(loops[a], loops[b])) continue;
      agrees.Set(a, b);
      agrees.Set(b, a);
      ++degree[a];
      ++degree[b];
    }
  }
  for (const std::size_t k : LargeClique(agrees, degree)) keep[loops[k].edge] = true;
  return keep;
}

}  // namespace tutti::internal
