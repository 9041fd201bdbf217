#include "core/numbers.h"

#include <gtest/gtest.h>

namespace tutti::internal {
namespace {

TEST(Median, IsTheMiddleInOrderOfSize) {
  EXPECT_EQ(Median<double>({3, 1, 2}), 2);
  EXPECT_EQ(Median<int>({7}), 7);
}

TEST(Median, OfAnEvenNumberIsTheLargerOfTheTwoInTheMiddle) { EXPECT_EQ(Median<float>({4, 1, 3, 2}), 3); }

TEST(Median, OfNoneIsZero) { EXPECT_EQ(Median<double>({}), 0); }

}  // namespace
}  // namespace tutti::internal
