// Photos as cameras write them, for tests.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <utility>
#include <vector>

namespace tutti::testing {

/// A value of a photo's EXIF: a whole number (denominator 0), or a fraction.
struct ExifValue {
  std::uint16_t tag = 0;
  std::uint32_t numerator = 0, denominator = 0;
};

constexpr std::uint16_t kFocalLength = 0x920A, kFocalLengthIn35mmFilm = 0xA405, kPixelXDimension = 0xA002,
                        kFocalPlaneXResolution = 0xA20E, kFocalPlaneResolutionUnit = 0xA210;

/// A grey JPEG with these in its EXIF.
inline void WritePhoto(const std::filesystem::path& file, cv::Size size,
                       const std::vector<ExifValue>& values) {
  std::string tiff("II*\0\x08\0\0\0", 8);
  const auto put = [&tiff](std::uint32_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) tiff += static_cast<char>(value >> (8 * i) & 0xFF);
  };
  // The first directory has the place of the second, which has the values; fractions stand behind it.
  put(1, 2);
  put(0x8769, 2), put(4, 2), put(1, 4), put(26, 4);
  put(0, 4);
  put(static_cast<std::uint32_t>(values.size()), 2);
  auto behind = static_cast<std::uint32_t>(26 + 2 + 12 * values.size() + 4);
  for (const ExifValue& value : values) {
    put(value.tag, 2);
    if (value.denominator == 0) {
      put(3, 2), put(1, 4), put(value.numerator, 4);
    } else {
      put(5, 2), put(1, 4), put(behind, 4);
      behind += 8;
    }
  }
  put(0, 4);
  for (const ExifValue& value : values) {
    if (value.denominator != 0) put(value.numerator, 4), put(value.denominator, 4);
  }
  const std::string segment = std::string("Exif\0\0", 6) + tiff;
  const auto length = static_cast<unsigned>(segment.size() + 2);
  std::vector<unsigned char> jpeg;
  cv::imencode(".jpg", cv::Mat(size, CV_8UC1, cv::Scalar(90)), jpeg);
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(jpeg.data()), 2);
  out << '\xFF' << '\xE1' << static_cast<char>(length >> 8) << static_cast<char>(length & 0xFF) << segment;
  out.write(reinterpret_cast<const char*>(jpeg.data()) + 2, static_cast<std::streamsize>(jpeg.size() - 2));
}

}  // namespace tutti::testing
