#include "loopclosure/features/whole_rows.h"

#include <gtest/gtest.h>

#include <limits>
#include <optional>
#include <random>

#include "loopclosure/store/packed_mat.h"

namespace tutti::internal {
namespace {

cv::Mat WholeNumbers(int rows, int cols, std::uint32_t seed) {
  std::mt19937 random(seed);
  cv::Mat matrix(rows, cols, CV_32F);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < cols; ++c) matrix.at<float>(r, c) = static_cast<float>(random() % 256);
  }
  return matrix;
}

// Counts and widths that are multiples of what is worked on at once, and others.
TEST(WholeRows, DistancesAreExact) {
  for (const int cols : {1, 2, 7, 128}) {
    for (const int count : {1, 15, 16, 33}) {
      const cv::Mat a = WholeNumbers(6, cols, 1), b = WholeNumbers(count, cols, 2);
      const std::optional<WholeRows> rows = WholeRows::Of(a, 1.0f), others = WholeRows::Of(b, 1.0f);
      ASSERT_TRUE(rows && others);
      const WholeRows::Columns columns(*others);
      WholeRows::Block distances;
      for (auto& each : distances) each.resize(static_cast<std::size_t>(count));
      for (int i = 0; i < a.rows; ++i) {
        if (i % WholeRows::kTogether == 0) rows->Distances(i, columns, distances);
        for (int j = 0; j < count; ++j) {
          const double expected = cv::norm(a.row(i), b.row(j), cv::NORM_L2SQR);
          EXPECT_EQ(
              distances.at(static_cast<std::size_t>(i % WholeRows::kTogether))[static_cast<std::size_t>(j)],
              expected);
        }
      }
    }
  }
}

TEST(WholeRows, SignedSquaresAreWholeNumbersToo) {
  cv::Mat row(1, 4, CV_32F);
  for (int c = 0; c < 4; ++c) row.at<float>(0, c) = SignedSquare(40 * c - 70);
  EXPECT_FALSE(WholeRows::Of(row, 1.0f));
  EXPECT_TRUE(WholeRows::Of(row, WholeRows::kSignedSquares));
}

TEST(WholeRows, OtherNumbersAreRefused) {
  const float nan = std::numeric_limits<float>::quiet_NaN(),
              infinity = std::numeric_limits<float>::infinity();
  for (const float value : {0.5f, 40000.0f, -40000.0f, nan, infinity}) {
    EXPECT_FALSE(WholeRows::Of(cv::Mat(2, 3, CV_32F, cv::Scalar(value)), 1.0f)) << value;
  }
  // Each fits 16 bits, and a distance would not fit 32.
  EXPECT_FALSE(WholeRows::Of(cv::Mat(1, 2, CV_32F, cv::Scalar(30000)), 1.0f));
}

}  // namespace
}  // namespace tutti::internal
