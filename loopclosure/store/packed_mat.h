// Matrices of descriptors in as few bytes as may be, in memory and in files.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>

namespace tutti::internal {

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
