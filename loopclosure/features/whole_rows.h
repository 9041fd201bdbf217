// Distances between many descriptors and many others, whose values are whole numbers. Internal.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace tutti::internal {

/// Descriptors as whole numbers of 16 bits: SIFT's values are such, SURF's are, times 128^2
/// (store/packed_mat.h). Their scalar products are exact, in any order, and so are the same on every machine.
class WholeRows {
 public:
  /// Makes whole numbers of signed squares.
  static constexpr float kSignedSquares = 128.0f * 128.0f;

  /// Rows of CV_32F times `scale`; nothing if a value is none, or a row is so long that a distance may not
  /// fit 32 bits.
  static std::optional<WholeRows> Of(const cv::Mat& rows, float scale);

  /// Rows as the other side of Distances needs them.
  class Columns {
   public:
    explicit Columns(const WholeRows& rows);

   private:
    friend class WholeRows;
    std::size_t padded_ = 0;            // rows, up to a multiple of what is worked on at once
    std::vector<std::int16_t> values_;  // two of each row, then the next two of each
    std::vector<std::int32_t> squares_;
  };

  static constexpr int kTogether = 4;  ///< rows of which Distances takes the distances at once
  using Block = std::array<std::vector<float>, kTogether>;

  /// Squared distances, times scale^2, of up to kTogether rows from `first` on to all of `others`: those of
  /// the k-th to distances[k], which must be as long as there are others.
  void Distances(int first, const Columns& others, Block& distances) const;

 private:
  int pairs_ = 0;                     // of values, of each row
  std::vector<std::int16_t> values_;  // row by row, and zeros for kTogether - 1 rows more
  std::vector<std::int32_t> squares_;
};

/// Squared distances of the rows of one matrix to those of another of the same type, CV_32F (Euclidean) or
/// CV_8U (Hamming), in units of scale()^-2. Both must outlive this object.
class RowDistances {
 public:
  RowDistances(const cv::Mat& query, const cv::Mat& candidate);

  /// From row i to the first `count` candidates at least; for i = 0, 1, 2, ... in this order.
  const std::vector<float>& To(int i, int count);
  float scale() const { return scale_; }

 private:
  const cv::Mat& query_;
  const cv::Mat& candidate_;
  float scale_ = 1.0f;
  std::optional<WholeRows> whole_query_;
  std::optional<WholeRows::Columns> columns_;  // of the candidates, if they are whole numbers, too
  WholeRows::Block distances_;
};

}  // namespace tutti::internal
