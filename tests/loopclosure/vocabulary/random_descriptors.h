// Descriptors that have nothing in common.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <random>

namespace tutti::testing {

/// Values from 0 to 1.
inline cv::Mat RandomFloats(int rows, int columns, std::uint32_t seed) {
  std::mt19937 generator(seed);
  cv::Mat m(rows, columns, CV_32F);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) m.at<float>(i, j) = static_cast<float>(generator() % 10000u) / 10000.0f;
  }
  return m;
}

/// Each row is a descriptor of 32 bytes.
inline cv::Mat RandomBytes(int rows, std::uint32_t seed) {
  std::mt19937 generator(seed);
  cv::Mat m(rows, 32, CV_8U);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < 32; ++j) m.at<std::uint8_t>(i, j) = static_cast<std::uint8_t>(generator() % 256u);
  }
  return m;
}

}  // namespace tutti::testing
