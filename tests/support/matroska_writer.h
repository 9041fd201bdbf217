// Videos whose frames have any times: Matroska (RFC 9559) with motion JPEG, or 16-bit grey, for tests.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace tutti::testing {

class MatroskaWriter {
 public:
  /// `shown`: the size for which the pixels are meant; none: they are square.
  /// `depth`: images are CV_16UC1, as they are.
  explicit MatroskaWriter(cv::Size size, cv::Size shown = {}, bool depth = false) : depth_(depth) {
    std::string video = Element(0xB0, Number(size.width)) + Element(0xBA, Number(size.height));
    if (shown.area() > 0)
      video += Element(0x54B0, Number(shown.width)) + Element(0x54BA, Number(shown.height));
    if (depth) video += Element(0x2EB524, std::string("Y1\0\x10", 4));  // FFmpeg calls it so
    const std::string track = Element(0xD7, Number(1)) + Element(0x73C5, Number(1)) +
                              Element(0x83, Number(1)) + Element(0x86, depth ? "V_UNCOMPRESSED" : "V_MJPEG") +
                              Element(0xE0, video);
    head_ = Element(0x1A45DFA3,
                    Element(0x4282, "matroska") + Element(0x4287, Number(2)) + Element(0x4285, Number(2)));
    body_ = Element(0x1549A966, Element(0x2AD7B1, Number(1000000))) +  // times are milliseconds
            Element(0x1654AE6B, Element(0xAE, track));
  }

  void Add(const cv::Mat& image, int milliseconds) {
    std::vector<unsigned char> bytes(image.datastart, image.dataend);
    if (!depth_) cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 95});
    const std::string block = std::string("\x81\0\0\x80", 4) + std::string(bytes.begin(), bytes.end());
    body_ += Element(0x1F43B675, Element(0xE7, Number(milliseconds)) + Element(0xA3, block));
  }

  std::string Bytes() const { return head_ + Element(0x18538067, body_); }
  void Write(const std::filesystem::path& file) const { std::ofstream(file, std::ios::binary) << Bytes(); }

 private:
  static std::string BigEndian(std::uint64_t value, int bytes) {
    std::string out;
    for (int i = bytes - 1; i >= 0; --i) out += static_cast<char>(value >> static_cast<unsigned>(8 * i));
    return out;
  }
  static std::string Number(int value) { return BigEndian(static_cast<std::uint64_t>(value), 4); }
  static std::string Element(std::uint32_t id, const std::string& content) {
    const int bytes = id > 0xFFFFFF ? 4 : id > 0xFFFF ? 3 : id > 0xFF ? 2 : 1;
    return BigEndian(id, bytes) + BigEndian((1ULL << 56U) | content.size(), 8) + content;
  }

  bool depth_;
  std::string head_, body_;
};

}  // namespace tutti::testing
