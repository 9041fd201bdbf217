// The state of OpenCV's types, for saved maps (core/state_archive.h).
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace tutti::internal {

template <class Archive>
void State(Archive& archive, cv::Point2f& point) {
  archive(point.x, point.y);
}

/// CV_8UC1.
template <class Archive>
void State(Archive& archive, cv::Mat& matrix) {
  std::int32_t rows = matrix.rows, columns = matrix.cols;
  std::vector<std::uint8_t> bytes;
  if constexpr (!Archive::kReading) {
    CV_Assert(matrix.empty() || matrix.type() == CV_8UC1);
    bytes.reserve(matrix.total());
    for (int r = 0; r < rows; ++r)
      bytes.insert(bytes.end(), matrix.ptr<std::uint8_t>(r), matrix.ptr<std::uint8_t>(r) + columns);
  }
  archive(rows, columns, bytes);
  if constexpr (Archive::kReading) {
    if (rows < 0 || columns < 0 || std::uint64_t(rows) * std::uint64_t(columns) != bytes.size())
      archive.Damaged("a matrix of an impossible size");
    matrix = bytes.empty() ? cv::Mat() : cv::Mat(rows, columns, CV_8UC1, bytes.data()).clone();
  }
}

}  // namespace tutti::internal
