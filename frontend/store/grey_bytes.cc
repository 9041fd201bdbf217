#include "frontend/store/grey_bytes.h"

#include <algorithm>
#include <cstdint>

namespace tutti::internal {
namespace {

constexpr int kMostSide = 1 << 16;  // [px]

int Guess(int left, int above, int above_left) {
  const int low = std::min(left, above), high = std::max(left, above);
  return std::min(std::max(left + above - above_left, low), high);
}

// Calls code(pixel, guess) for each pixel, whose neighbours have their values by then. `Pixel`: const or not.
template <class Pixel, class Image, class Code>
void ForEachPixel(Image& image, const Code& code) {
  if (image.cols == 0) return;
  Pixel* above = nullptr;
  for (int y = 0; y < image.rows; ++y) {
    Pixel* const row = image.template ptr<std::uint8_t>(y);
    code(row[0], above != nullptr ? above[0] : 0);
    if (above == nullptr) {
      for (int x = 1; x < image.cols; ++x) code(row[x], row[x - 1]);
    } else {
      for (int x = 1; x < image.cols; ++x) code(row[x], Guess(row[x - 1], above[x], above[x - 1]));
    }
    above = row;
  }
}

}  // namespace

std::string PutGrey(const cv::Mat& image) {
  std::string rest;
  rest.reserve(image.total());
  ForEachPixel<const std::uint8_t>(
      image, [&](std::uint8_t pixel, int guess) { rest.push_back(static_cast<char>(pixel - guess)); });
  return rest;
}

bool IsGrey(const std::string& bytes, int rows, int columns) {
  if (rows < 0 || columns < 0 || rows > kMostSide || columns > kMostSide) return false;
  return std::uint64_t(rows) * std::uint64_t(columns) == bytes.size();
}

bool GetGrey(const std::string& bytes, cv::Mat* image) {
  if (!IsGrey(bytes, image->rows, image->cols)) return false;
  const char* next = bytes.data();
  ForEachPixel<std::uint8_t>(
      *image, [&](std::uint8_t& pixel, int guess) { pixel = static_cast<std::uint8_t>(guess + *next++); });
  return true;
}

}  // namespace tutti::internal
