#include "frontend/store/grey_bytes.h"

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <new>
#include <vector>

namespace tutti::internal {
namespace {

constexpr int kMostSide = 1 << 16;         // [px]
constexpr std::uint64_t kMostGain = 1100;  // of zlib, a bit more than it says

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

std::string PackGrey(const cv::Mat& image) {
  std::vector<std::uint8_t> rest;
  rest.reserve(image.total());
  ForEachPixel<const std::uint8_t>(image, [&](std::uint8_t pixel, int guess) {
    rest.push_back(static_cast<std::uint8_t>(pixel - guess));
  });
  z_stream stream{};
  if (deflateInit2(&stream, 1, Z_DEFLATED, MAX_WBITS, MAX_MEM_LEVEL, Z_HUFFMAN_ONLY) != Z_OK)
    throw std::bad_alloc();  // the only thing that can be wrong
  std::string packed(deflateBound(&stream, static_cast<uLong>(rest.size())), '\0');
  stream.next_in = rest.data();
  stream.avail_in = static_cast<uInt>(rest.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

bool CanBeGrey(const std::string& bytes, int rows, int columns) {
  if (rows < 0 || columns < 0 || rows > kMostSide || columns > kMostSide) return false;
  return std::uint64_t(rows) * std::uint64_t(columns) <= kMostGain * bytes.size();
}

bool UnpackGrey(const std::string& bytes, cv::Mat* image) {
  std::vector<std::uint8_t> rest(std::max<std::size_t>(1, image->total()));
  uLongf size = static_cast<uLongf>(rest.size());
  if (uncompress(rest.data(), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                 static_cast<uLong>(bytes.size())) != Z_OK ||
      size != image->total())
    return false;
  const std::uint8_t* next = rest.data();
  ForEachPixel<std::uint8_t>(
      *image, [&](std::uint8_t& pixel, int guess) { pixel = static_cast<std::uint8_t>(guess + *next++); });
  return true;
}

}  // namespace tutti::internal
