#include "backend/graph/neighbourhood.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

using internal::GraphStructure;
using internal::Neighbourhood;
using Positions = std::vector<std::size_t>;

/// A ring of ten nodes; node 0 is held.
GraphStructure Ring() {
  GraphStructure ring;
  for (std::size_t k = 0; k < 10; ++k) ring.ends.push_back({k, (k + 1) % 10});
  ring.constant.assign(10, false);
  ring.constant[0] = true;
  return ring;
}

TEST(Neighbourhood, GrowsHopByHopAndNotThroughHeldNodes) {
  const GraphStructure ring = Ring();
  const Neighbourhood around(ring);
  Positions nodes;
  std::vector<bool> inside(10);
  around.Grow({2}, 1, nodes, inside);
  EXPECT_EQ(nodes, (Positions{2, 1, 3}));
  around.Grow({1}, 3, nodes, inside);
  EXPECT_EQ(nodes, (Positions{2, 1, 3, 4}));
  EXPECT_FALSE(inside[0]);
  EXPECT_FALSE(inside[9]);
}

TEST(Neighbourhood, TheShortestPathGoesRoundTheEdgesThatItMayNotTake) {
  const GraphStructure ring = Ring();
  const Neighbourhood around(ring);
  std::vector<bool> without(10);
  EXPECT_EQ(around.Path(1, 4, without), (Positions{1, 2, 3, 4}));
  without[2] = true;
  EXPECT_EQ(around.Path(1, 4, without), (Positions{1, 0, 9, 8, 7, 6, 5, 4}));
  without[7] = true;
  EXPECT_TRUE(around.Path(1, 4, without).empty());
}

}  // namespace
}  // namespace tutti
