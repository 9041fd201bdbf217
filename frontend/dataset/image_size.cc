#include "frontend/dataset/image_size.h"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <string>

namespace tutti {
namespace {

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

bool Has(const Bytes& b, std::size_t at, const char* text, std::size_t size) {
  return b.size() >= at + size && std::memcmp(b.data() + at, text, size) == 0;
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

}  // namespace

std::optional<ClaimedSize> SizeInHeader(const std::vector<unsigned char>& b) {
  if (b.size() < 30) return std::nullopt;
  if (Has(b, 0, "\x89PNG", 4)) return ClaimedSize{Big(b, 16, 4), Big(b, 20, 4)};
  if (Has(b, 0, "\xFF\xD8", 2)) return Jpeg(b);
  if (Has(b, 0, "BM", 2)) return ClaimedSize{Magnitude(Little(b, 18, 4)), Magnitude(Little(b, 22, 4))};
  if (b[0] == 'P' && b[1] >= '1' && b[1] <= '6') return Pnm(b);
  if (Has(b, 0, "II*\0", 4) || Has(b, 0, "MM\0*", 4)) return Tiff(b);
  if (Has(b, 8, "WEBPVP8X", 8)) return ClaimedSize{Little(b, 24, 3) + 1, Little(b, 27, 3) + 1};
  if (Has(b, 4, "jP  ", 4)) return Jpeg2000(b);
  return std::nullopt;
}

}  // namespace tutti
