// PNG (ISO/IEC 15948), written with zlib alone: OpenCV's writer loads 120 libraries when a program starts.
#include <zlib.h>

#include <cstdint>
#include <fstream>
#include <opencv2/core.hpp>
#include <string>

#include "apps/plot/plot_picture.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr int kLevel = 6;  // zlib's default

std::string BigEndian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
  return bytes;
}

const Bytef* Bytes(const std::string& text) { return reinterpret_cast<const Bytef*>(text.data()); }

// A type of four letters and its data.
std::string Chunk(const std::string& type_and_data) {
  const uLong sum = crc32(0, Bytes(type_and_data), static_cast<uInt>(type_and_data.size()));
  return BigEndian(static_cast<std::uint32_t>(type_and_data.size() - 4)) + type_and_data +
         BigEndian(static_cast<std::uint32_t>(sum));
}

// Each row: the filter "Sub" (1), then R, G, B of each pixel, less those of the pixel on its left.
std::string FilteredRows(const cv::Mat& picture) {
  std::string rows;
  rows.reserve(static_cast<std::size_t>(picture.rows) * (3 * static_cast<std::size_t>(picture.cols) + 1));
  for (int y = 0; y < picture.rows; ++y) {
    rows += '\1';
    cv::Vec3b left(0, 0, 0);
    for (int x = 0; x < picture.cols; ++x) {
      const cv::Vec3b& pixel = picture.at<cv::Vec3b>(y, x);
      for (int channel = 2; channel >= 0; --channel)
        rows += static_cast<char>(pixel[channel] - left[channel]);
      left = pixel;
    }
  }
  return rows;
}

std::string Compressed(const std::string& data) {
  uLongf size = compressBound(static_cast<uLong>(data.size()));
  std::string out(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(out.data()), &size, Bytes(data), static_cast<uLong>(data.size()),
                kLevel) != Z_OK)
    throw InputError("the machine is out of memory");
  out.resize(size);
  return out;
}

}  // namespace

void WritePicture(const std::filesystem::path& file, const cv::Mat& picture) {
  const std::string header = BigEndian(static_cast<std::uint32_t>(picture.cols)) +
                             BigEndian(static_cast<std::uint32_t>(picture.rows)) +
                             std::string("\x08\x02\0\0\0", 5);  // 8 bits, RGB, not interlaced
  std::ofstream out(file, std::ios::binary);
  out << "\x89PNG\r\n\x1a\n"
      << Chunk("IHDR" + header) << Chunk("IDAT" + Compressed(FilteredRows(picture))) << Chunk("IEND");
  out.close();
  if (!out)
    throw InputError(file.string() + ": can't be written; check that the folder is writable and not full");
}

}  // namespace tutti
