// Matrices of descriptors in as few bytes as may be, in memory and in files.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>

namespace tutti::internal {

// Signed squares: numbers of -1 to 1 of which each fits a byte, finest next to 0, where most of a
// descriptor's are.

inline constexpr int kMostRoot = 127;  ///< of a signed square: the next, 128, would be 1

/// The root of the signed square that is nearest by its root: -kMostRoot .. kMostRoot. `value` is a number.
inline int SignedRoot(float value) {
  const int root = static_cast<int>(std::lround(std::sqrt(std::min(std::abs(value), 1.0f)) * 128));
  return std::copysign(1.0f, value) < 0 ? -std::min(root, kMostRoot) : std::min(root, kMostRoot);
}
inline float SignedSquare(int root) { return static_cast<float>(root * std::abs(root)) / (128 * 128); }

/// A matrix of CV_8U or CV_32F, without loss. CV_32F takes a byte a value where all are whole numbers 0..255
/// (SIFT) or signed squares (SURF). Copies share what they hold, as those of cv::Mat do.
class PackedMat {
 public:
  PackedMat() = default;
  /// Shares the matrix's memory where nothing is packed.
  PackedMat(const cv::Mat& matrix);  // NOLINT(google-explicit-constructor): the same by another name

  /// The matrix, N x D: in memory of its own where it was packed.
  cv::Mat Unpacked() const;
  /// One row of Unpacked(), in its bytes, into as many as there are.
  void CopyRow(int row, std::uint8_t* to) const;

  bool empty() const { return values_.empty(); }
  int rows() const { return values_.rows; }
  int cols() const { return values_.cols; }
  int type() const { return code_ != nullptr ? CV_32F : values_.type(); }

  /// Laid out such that zstd makes less of it.
  template <class Archive>
  void State(Archive& archive);

 private:
  enum class Kind : std::uint8_t { kEmpty, kBytes, kFloatPlanes, kWholeAsBytes, kSquaresAsBytes };
  struct Code;
  static const std::array<Code, 2>& Codes();

  cv::Mat values_;              // CV_8U where there is a code
  const Code* code_ = nullptr;  // of each value; null: they are as they were
};

}  // namespace tutti::internal
