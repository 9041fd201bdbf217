// Matrices of descriptors as bytes and back.
#include "loopclosure/store/mat_bytes.h"

#include <gtest/gtest.h>

#include <string>

#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

std::string BytesOfMat(const cv::Mat& matrix) {
  ByteWriter out;
  PutMat(matrix, out);
  return std::string(out.bytes());
}

cv::Mat MatOf(const std::string& bytes) {
  ByteReader in(bytes, "test");
  cv::Mat matrix = GetMat(in);
  EXPECT_EQ(in.Left(), 0u);
  return matrix;
}

cv::Mat RandomMat(int rows, int columns, int type, double low, double high) {
  cv::Mat matrix(rows, columns, type);
  cv::RNG(static_cast<std::uint64_t>(100 * rows + columns)).fill(matrix, cv::RNG::UNIFORM, low, high);
  return matrix;
}

void ExpectRoundTrip(const cv::Mat& matrix) {
  const cv::Mat back = MatOf(BytesOfMat(matrix));
  ASSERT_EQ(back.type(), matrix.type());
  ASSERT_EQ(back.size(), matrix.size());
  EXPECT_EQ(cv::norm(back, matrix, cv::NORM_INF), 0) << matrix.size();
}

// A single row, a single column, and columns of any remainder by four, in which they are kept.
TEST(MatBytes, OfAnySizeComeBackTheSame) {
  for (const int rows : {1, 2, 7}) {
    for (const int columns : {1, 2, 3, 4, 5, 32, 66}) {
      ExpectRoundTrip(RandomMat(rows, columns, CV_8U, 0, 256));
      ExpectRoundTrip(RandomMat(rows, columns, CV_32F, -1, 1));
      cv::Mat whole = RandomMat(rows, columns, CV_8U, 0, 256);
      whole.convertTo(whole, CV_32F);
      ExpectRoundTrip(whole);
    }
  }
  EXPECT_TRUE(MatOf(BytesOfMat(cv::Mat())).empty());
  ExpectRoundTrip(RandomMat(9, 40, CV_8U, 0, 256).colRange(3, 20));
  ExpectRoundTrip(RandomMat(9, 40, CV_32F, -1, 1).colRange(3, 20));
}

// 128 features of SIFT, for example.
TEST(MatBytes, ASquareMatrixStaysAsItIs) {
  cv::Mat matrix = RandomMat(128, 128, CV_8U, 0, 256);
  matrix.convertTo(matrix, CV_32F);
  const cv::Mat before = matrix.clone();
  ExpectRoundTrip(matrix);
  EXPECT_EQ(cv::norm(matrix, before, cv::NORM_INF), 0);
}

TEST(MatBytes, FloatsTakeAByteWhereAllAreWholeNumbersThatFitIt) {
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

TEST(MatBytes, DamagedOnesAreRefused) {
  for (const cv::Mat& matrix : {RandomMat(3, 5, CV_8U, 0, 256), RandomMat(3, 5, CV_32F, -1, 1)}) {
    const std::string good = BytesOfMat(matrix);
    for (std::size_t length = 0; length < good.size(); ++length) {
      const std::string cut = good.substr(0, length);
      ByteReader in(cut, "test");
      EXPECT_THROW(GetMat(in), InputError) << length << " of " << good.size();
    }
    // Kind, then rows and columns in four bytes each.
    for (const std::size_t at : {1u, 5u}) {
      for (const char value : {'\0', '\xff'}) {
        std::string bad = good;
        for (std::size_t k = 0; k < 4; ++k) bad[at + k] = value;
        ByteReader in(bad, "test");
        EXPECT_THROW(GetMat(in), InputError);
      }
    }
    std::string unknown = good;
    unknown[0] = 4;
    ByteReader in(unknown, "test");
    EXPECT_THROW(GetMat(in), InputError);
  }
}

}  // namespace
}  // namespace tutti::internal
