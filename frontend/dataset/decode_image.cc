// How large the bytes of an image file say that it is, whether they are all there, and its pixels.
#include <algorithm>
#include <cctype>
#include <cstring>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "frontend/dataset/image_file.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

using namespace std::string_view_literals;
using Bytes = std::vector<unsigned char>;

// A whole number of `size` bytes; 0 beyond the end.
std::uint64_t Big(const Bytes& b, std::size_t at, std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i) value = (value << 8) | (at + i < b.size() ? b[at + i] : 0U);
  return value;
}
std::uint64_t Little(const Bytes& b, std::size_t at, std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = size; i-- > 0;) value = (value << 8) | (at + i < b.size() ? b[at + i] : 0U);
  return value;
}

bool Has(const Bytes& b, std::size_t at, std::string_view text) {
  return b.size() >= at + text.size() && std::memcmp(b.data() + at, text.data(), text.size()) == 0;
}

// The frame header (SOF) among the segments.
std::optional<ClaimedSize> Jpeg(const Bytes& b) {
  std::size_t at = 2;
  while (at + 9 <= b.size() && b[at] == 0xFF) {
    const unsigned char marker = b[at + 1];
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    const bool frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (frame) return ClaimedSize{Big(b, at + 7, 2), Big(b, at + 5, 2)};
    at += 2 + Big(b, at + 2, 2);
  }
  return std::nullopt;
}

// "P5 # a comment", width and height.
std::optional<ClaimedSize> Pnm(const Bytes& b) {
  std::uint64_t numbers[2] = {0, 0};
  std::size_t at = 2;
  for (std::uint64_t& number : numbers) {
    while (at < b.size() && (std::isspace(b[at]) != 0 || b[at] == '#')) {
      if (b[at] == '#')
        while (at < b.size() && b[at] != '\n') ++at;
      else
        ++at;
    }
    if (at >= b.size() || std::isdigit(b[at]) == 0) return std::nullopt;
    constexpr std::uint64_t kBeyond = 1000000000;  // no overflow
    for (; at < b.size() && std::isdigit(b[at]) != 0; ++at)
      number = std::min(kBeyond, number * 10 + (b[at] - std::uint64_t{'0'}));
  }
  return ClaimedSize{numbers[0], numbers[1]};
}

// Tags 256 and 257 of the first directory.
std::optional<ClaimedSize> Tiff(const Bytes& b) {
  const auto number = b[0] == 'M' ? Big : Little;
  const std::size_t directory = number(b, 4, 4);
  ClaimedSize size;
  for (std::size_t i = 0; i < number(b, directory, 2); ++i) {
    const std::size_t at = directory + 2 + 12 * i;
    if (at + 12 > b.size()) break;
    const std::uint64_t value = number(b, at + 8, number(b, at + 2, 2) == 3 ? 2 : 4);
    if (number(b, at, 2) == 256) size.width = value;
    if (number(b, at, 2) == 257) size.height = value;
  }
  return size;
}

std::optional<ClaimedSize> Jpeg2000(const Bytes& b) {
  static const std::string kBox = "ihdr";
  const auto end = b.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(b.size(), 4096));
  const auto box = std::search(b.begin(), end, kBox.begin(), kBox.end());
  if (box == end) return std::nullopt;
  const auto at = static_cast<std::size_t>(box - b.begin()) + kBox.size();
  return ClaimedSize{Big(b, at + 4, 4), Big(b, at, 4)};
}

// BMP: heights below 0 are of images that begin with the top row.
std::uint64_t Magnitude(std::uint64_t value) { return value > 0x7FFFFFFFU ? 0x100000000U - value : value; }

// PNG: chunks of (length, type, data, checksum) up to IEND.
bool PngIsComplete(const Bytes& b) {
  std::size_t at = 8;
  while (at + 12 <= b.size()) {
    const std::size_t length = Big(b, at, 4);
    if (Has(b, at + 4, "IEND"sv)) return true;
    at += 12 + length;
  }
  return false;
}

// JPEG: segments up to the first scan (SOS), then coded data in which a true FF D9 can only be the end of the
// image. An embedded thumbnail's own end lies before the first scan.
bool JpegIsComplete(const Bytes& b) {
  std::size_t at = 2;
  while (at + 4 <= b.size()) {
    if (b[at] != 0xFF) return false;
    const unsigned char marker = b[at + 1];
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    if (marker == 0xDA) break;
    at += 2 + Big(b, at + 2, 2);
  }
  for (std::size_t i = b.size(); i-- > at + 1;) {
    if (b[i] == 0xD9 && b[i - 1] == 0xFF) return true;
  }
  return false;
}

// A few bytes may claim any size.
std::string TooLarge(const ClaimedSize& size) {
  if (size.width == 0 || size.height <= kMostImagePixels / size.width) return {};
  return "says that it has " + std::to_string(size.width) + " x " + std::to_string(size.height) +
         " pixels; at most " + std::to_string(kMostImagePixels / 1000000) + " million are read";
}

// What is wrong with the bytes of an image file; empty if nothing is seen from outside.
std::string Damage(const Bytes& b) {
  if (b.empty()) return "is empty (0 bytes)";
  std::string too_large = TooLarge(SizeInHeader(b).value_or(ClaimedSize()));
  if (!too_large.empty()) return too_large;
  bool complete = true;
  if (Has(b, 0, "\x89PNG\r\n\x1a\n"sv)) {
    complete = PngIsComplete(b);
  } else if (Has(b, 0, "\xFF\xD8"sv)) {
    complete = JpegIsComplete(b);
  } else if (Has(b, 0, "RIFF"sv) && Has(b, 8, "WEBP"sv)) {
    complete = b.size() >= Little(b, 4, 4) + 8;
  } else if (Has(b, 0, "BM"sv) && b.size() >= 6) {
    complete = b.size() >= Little(b, 2, 4);
  }
  return complete ? std::string() : "is truncated (it ends after " + std::to_string(b.size()) + " bytes)";
}

constexpr std::size_t kMostNpyHeaderBytes = 65536;

// What stands behind 'key': in the header, a Python dictionary, up to `end`.
std::string NpyValueOf(const std::string& header, const std::string& key, char end) {
  const std::size_t at = header.find("'" + key + "':");
  if (at == std::string::npos) return {};
  const std::size_t begin = at + key.size() + 3, stop = header.find(end, begin);
  return stop == std::string::npos ? std::string() : header.substr(begin, stop - begin);
}

// What is wrong; empty: `image` has the size and the type of the array.
// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
std::string ParseNpyHeader(const std::string& header, ClaimedSize* size, int* type) {
  static const std::map<std::string, int> kTypes = {
      {"<f4", CV_32FC1}, {"<f8", CV_64FC1}, {"<f2", CV_16FC1}, {"<u2", CV_16UC1}};
  const std::string name = JoinText(SplitText(NpyValueOf(header, "descr", ','), " '\""), "");
  const auto known = kTypes.find(name);
  if (known == kTypes.end())
    return "has numbers of type '" + name.substr(0, 20) +
           "'; float16, float32, float64 and uint16 can be read";
  *type = known->second;
  if (NpyValueOf(header, "fortran_order", ',').find("False") == std::string::npos)
    return "is not in C order; save it with numpy.ascontiguousarray";
  const std::string shape = NpyValueOf(header, "shape", ')');
  std::vector<std::uint64_t> sides;
  for (const std::string& word : SplitText(shape, " (,")) {
    const std::optional<long long> side = ParseInteger(word);
    if (!side || *side < 1) return "has the shape " + shape.substr(0, 40) + ")";
    if (*side != 1 || sides.size() < 2) sides.push_back(static_cast<std::uint64_t>(*side));
  }
  if (sides.size() == 3 && sides.front() == 1) sides.erase(sides.begin());
  if (sides.size() != 2) return "is no image: its shape has " + std::to_string(sides.size()) + " dimensions";
  *size = {sides[1], sides[0]};
  return TooLarge(*size);
}

// What is wrong; empty: `image` is set.
std::string ReadNpy(const Bytes& b, cv::Mat& image) {
  if (b.size() < 12 || !Has(b, 0, "\x93NUMPY"sv)) return "is no array of NumPy";
  const bool wide = b[6] >= 2;  // the header's length has four bytes
  const std::size_t begin = wide ? 12 : 10, length = Little(b, 8, wide ? 4 : 2);
  if (length > kMostNpyHeaderBytes || begin + length > b.size()) return "has a damaged header";
  const char* const header = reinterpret_cast<const char*>(b.data()) + begin;
  ClaimedSize size;
  int type = -1;
  std::string problem = ParseNpyHeader(std::string(header, length), &size, &type);
  if (!problem.empty()) return problem;
  const std::uint64_t need = size.width * size.height * CV_ELEM_SIZE(type);
  if (b.size() - begin - length < need)
    return "is truncated (it ends after " + std::to_string(b.size()) + " bytes)";
  image.create(static_cast<int>(size.height), static_cast<int>(size.width), type);
  std::memcpy(image.data, header + length, need);
  if (type != CV_16UC1) image.convertTo(image, CV_32F);
  return {};
}

}  // namespace

std::optional<ClaimedSize> SizeInHeader(const std::vector<unsigned char>& b) {
  if (b.size() < 30) return std::nullopt;
  if (Has(b, 0, "\x89PNG"sv)) return ClaimedSize{Big(b, 16, 4), Big(b, 20, 4)};
  if (Has(b, 0, "\xFF\xD8"sv)) return Jpeg(b);
  if (Has(b, 0, "BM"sv)) return ClaimedSize{Magnitude(Little(b, 18, 4)), Magnitude(Little(b, 22, 4))};
  if (b[0] == 'P' && b[1] >= '1' && b[1] <= '6') return Pnm(b);
  if (Has(b, 0, "II*\0"sv) || Has(b, 0, "MM\0*"sv)) return Tiff(b);
  if (Has(b, 8, "WEBPVP8X"sv)) return ClaimedSize{Little(b, 24, 3) + 1, Little(b, 27, 3) + 1};
  if (Has(b, 4, "jP  "sv)) return Jpeg2000(b);
  return std::nullopt;
}

ImageFile DecodeImage(const std::vector<unsigned char>& bytes, int flags) {
  ImageFile out;
  out.error = Damage(bytes);
  if (!out.error.empty()) return out;
  try {
    out.image = cv::imdecode(bytes, flags);
  } catch (const cv::Exception&) {
    out.image.release();
  }
  if (out.image.empty()) out.error = "is damaged or not an image that OpenCV can decode";
  return out;
}

ImageFile DecodeNpy(const std::vector<unsigned char>& bytes) {
  ImageFile out;
  try {
    out.error = ReadNpy(bytes, out.image);
  } catch (const std::exception&) {  // out of memory
    out.error = "can't be read: there is not enough memory";
  }
  if (!out.error.empty()) out.image.release();
  return out;
}

}  // namespace tutti
