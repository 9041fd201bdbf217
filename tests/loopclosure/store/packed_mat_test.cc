// Matrices of descriptors as fewer bytes and back.
#include "loopclosure/store/packed_mat.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "core/state_archive.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

std::string BytesOfMat(const cv::Mat& matrix) { return StateBytes(PackedMat(matrix)); }

cv::Mat MatOf(const std::string& bytes) {
  PackedMat packed;
  ReadStateBytes(bytes, "test", packed);
  return packed.Unpacked();
}

cv::Mat RandomMat(int rows, int columns, int type, double low, double high) {
  cv::Mat matrix(rows, columns, type);
  cv::RNG(static_cast<std::uint64_t>(100 * rows + columns)).fill(matrix, cv::RNG::UNIFORM, low, high);
  return matrix;
}

void ExpectTheSame(const cv::Mat& back, const cv::Mat& matrix) {
  ASSERT_EQ(back.type(), matrix.type());
  ASSERT_EQ(back.size(), matrix.size());
  EXPECT_EQ(cv::norm(back, matrix, cv::NORM_INF), 0) << matrix.size();
}

void ExpectRoundTrip(const cv::Mat& matrix) {
  const PackedMat packed(matrix);
  EXPECT_EQ(packed.rows(), matrix.rows);
  EXPECT_EQ(packed.cols(), matrix.cols);
  EXPECT_EQ(packed.type(), matrix.type());
  ExpectTheSame(packed.Unpacked(), matrix);
  ExpectTheSame(MatOf(BytesOfMat(matrix)), matrix);
  cv::Mat rows(matrix.size(), matrix.type());
  for (int r = 0; r < rows.rows; ++r) packed.CopyRow(r, rows.ptr(r));
  ExpectTheSame(rows, matrix);
}

// A single row, a single column, and columns of any remainder by four, in which they are kept.
TEST(PackedMat, OfAnySizeComeBackTheSame) {
  for (const int rows : {1, 2, 7}) {
    for (const int columns : {1, 2, 3, 4, 5, 32, 66}) {
      ExpectRoundTrip(RandomMat(rows, columns, CV_8U, 0, 256));
      ExpectRoundTrip(RandomMat(rows, columns, CV_32F, -1, 1));
      cv::Mat whole = RandomMat(rows, columns, CV_8U, 0, 255);
      whole.convertTo(whole, CV_32F);
      ExpectRoundTrip(whole);
      for (auto v = whole.begin<float>(); v != whole.end<float>(); ++v)
        *v = SignedSquare(static_cast<int>(*v) - 127);
      ExpectRoundTrip(whole);
    }
  }
  EXPECT_TRUE(MatOf(BytesOfMat(cv::Mat())).empty());
  ExpectRoundTrip(RandomMat(9, 40, CV_8U, 0, 256).colRange(3, 20));
  ExpectRoundTrip(RandomMat(9, 40, CV_32F, -1, 1).colRange(3, 20));
}

// 128 features of SIFT, for example.
TEST(PackedMat, ASquareMatrixStaysAsItIs) {
  cv::Mat matrix = RandomMat(128, 128, CV_8U, 0, 256);
  matrix.convertTo(matrix, CV_32F);
  const cv::Mat before = matrix.clone();
  ExpectRoundTrip(matrix);
  EXPECT_EQ(cv::norm(matrix, before, cv::NORM_INF), 0);
}

TEST(PackedMat, FloatsTakeAByteWhereAllAreWholeNumbersThatFitIt) {
  cv::Mat matrix(3, 8, CV_32F, cv::Scalar(255));
  const std::size_t packed = BytesOfMat(matrix).size();
  EXPECT_LT(packed, 24u + 16u);
  matrix.at<float>(2, 3) = 0;
  EXPECT_EQ(BytesOfMat(matrix).size(), packed);
  for (const float other : {256.0f, -1.0f, 0.5f}) {
    matrix.at<float>(2, 3) = other;
    EXPECT_GE(BytesOfMat(matrix).size(), 24u * 4u) << other;
    ExpectRoundTrip(matrix);
  }
}

TEST(PackedMat, FloatsTakeAByteWhereAllAreSignedSquares) {
  cv::Mat matrix(3, 8, CV_32F, cv::Scalar(SignedSquare(-kMostRoot)));
  matrix.at<float>(0, 1) = SignedSquare(kMostRoot);
  EXPECT_LT(BytesOfMat(matrix).size(), 24u + 16u);
  ExpectRoundTrip(matrix);
  for (const float other : {1.0f, 1.5f, 1.0f / (1 << 15), -0.0f}) {
    matrix.at<float>(2, 3) = other;
    EXPECT_GE(BytesOfMat(matrix).size(), 24u * 4u) << other;
    ExpectRoundTrip(matrix);
  }
}

// Where a detector looks descriptors up by their bits.
TEST(PackedMat, ZeroKeepsItsSign) {
  for (const float zero : {0.0f, -0.0f}) {
    const cv::Mat back = MatOf(BytesOfMat(cv::Mat(2, 3, CV_32F, cv::Scalar(zero))));
    EXPECT_EQ(std::signbit(back.at<float>(1, 2)), std::signbit(zero));
  }
}

TEST(SignedSquares, AreTheNearestByTheirRoots) {
  for (int root = -kMostRoot; root <= kMostRoot; ++root) {
    EXPECT_EQ(SignedRoot(SignedSquare(root)), root);
    EXPECT_LT(SignedSquare(root - 1), SignedSquare(root));
  }
  EXPECT_EQ(SignedRoot(0.25f + 0.003f), 64);
  EXPECT_EQ(SignedRoot(-0.25f - 0.005f), -65);
  EXPECT_EQ(SignedRoot(1), kMostRoot);
  EXPECT_EQ(SignedRoot(-7), -kMostRoot);
  EXPECT_FALSE(std::signbit(SignedSquare(SignedRoot(-1e-6f))));
}

TEST(PackedMat, DamagedOnesAreRefused) {
  cv::Mat bytes = RandomMat(3, 5, CV_8U, 0, 255), steps;
  steps.create(bytes.size(), CV_32F);
  std::transform(bytes.begin<std::uint8_t>(), bytes.end<std::uint8_t>(), steps.begin<float>(),
                 [](int byte) { return SignedSquare(byte - 127); });
  for (const cv::Mat& matrix : {bytes, RandomMat(3, 5, CV_32F, -1, 1), steps}) {
    const std::string good = BytesOfMat(matrix);
    for (std::size_t length = 0; length < good.size(); ++length) {
      EXPECT_THROW(MatOf(good.substr(0, length)), InputError) << length << " of " << good.size();
    }
    // Kind, then rows and columns in four bytes each.
    for (const std::size_t at : {1u, 5u}) {
      for (const char value : {'\0', '\xff'}) {
        std::string bad = good;
        for (std::size_t k = 0; k < 4; ++k) bad[at + k] = value;
        EXPECT_THROW(MatOf(bad), InputError);
      }
    }
    std::string unknown = good;
    unknown[0] = 5;
    EXPECT_THROW(MatOf(unknown), InputError);
  }
}

}  // namespace
}  // namespace tutti::internal
