#include "apps/report/base64.h"

#include <algorithm>

namespace tutti {

std::string Base64(const void* bytes, std::size_t size) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto* in = static_cast<const unsigned char*>(bytes);
  std::string out;
  out.reserve((size + 2) / 3 * 4);
  for (std::size_t i = 0; i < size; i += 3) {
    const std::size_t left = std::min<std::size_t>(3, size - i);
    const unsigned long word = static_cast<unsigned long>(in[i]) << 16 |
                               (left > 1 ? static_cast<unsigned long>(in[i + 1]) << 8 : 0) |
                               (left > 2 ? static_cast<unsigned long>(in[i + 2]) : 0);
    for (std::size_t k = 0; k < 4; ++k) out += k <= left ? kDigits[word >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

}  // namespace tutti
