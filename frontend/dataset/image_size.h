// How large an image says it is, without decoding it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace tutti {

struct ClaimedSize {
  std::uint64_t width = 0, height = 0;  ///< [px]
};

/// From the header of PNG, JPEG, BMP, PNM, TIFF, WebP (extended) and JPEG 2000; nothing of other bytes, or
/// where the header is cut off.
std::optional<ClaimedSize> SizeInHeader(const std::vector<unsigned char>& bytes);

}  // namespace tutti
