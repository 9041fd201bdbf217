// Hamming distance of binary descriptors. Internal.
#pragma once

#include <cstdint>
#include <cstring>

namespace tutti::internal {

/// Differing bits of two descriptors of `bytes` bytes.
inline int HammingDistance(const std::uint8_t* a, const std::uint8_t* b, int bytes) {
  int bits = 0;
  int i = 0;
  for (; i + 8 <= bytes; i += 8) {
    std::uint64_t x = 0;
    std::uint64_t y = 0;
    std::memcpy(&x, a + i, 8);
    std::memcpy(&y, b + i, 8);
    bits += __builtin_popcountll(x ^ y);
  }
  for (; i < bytes; ++i) bits += __builtin_popcount(static_cast<unsigned>(a[i] ^ b[i]));
  return bits;
}

}  // namespace tutti::internal

// Compiled once for plain x86-64 and once with the popcnt instruction, chosen at run time; both give the same
// numbers.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define TUTTI_POPCOUNT_CLONES __attribute__((target_clones("default", "popcnt")))
#else
#define TUTTI_POPCOUNT_CLONES
#endif
