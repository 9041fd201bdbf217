// Distances of one descriptor to many. Internal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "core/inner_loops.h"

namespace tutti::internal {

/// Differing bits of two descriptors of `bytes` bytes, which the caller checks as a whole.
TUTTI_CHECKED_AS_A_WHOLE inline int HammingDistance(const std::uint8_t* a, const std::uint8_t* b, int bytes) {
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

/// Squared Euclidean distances of a row to `count` rows that lie `step` floats apart. The same bits on every
/// machine and for every alignment: sums in a fixed order, no fused multiply-add.
void SquaredDistances(const float* query, const float* rows, int count, int dimensions, std::size_t step,
                      float* distances);

/// Hamming distances in bits of a row to `count` rows that lie `step` bytes apart.
void HammingDistances(const std::uint8_t* query, const std::uint8_t* rows, int count, int bytes,
                      std::size_t step, float* distances);

/// The least of `count` > 0 distances (none negative); and where distances[j] < nearest[j], nearest[j] and
/// nearest_row[j] become distances[j] and `row`.
float UpdateNearest(const float* distances, int count, int row, float* nearest, std::int32_t* nearest_row);

/// The least of `count` distances (none negative) of those whose place (x[j], y[j]) is more than `apart` from
/// (x0, y0); infinity if there is none.
float NearestElsewhere(const float* distances, const float* x, const float* y, int count, float x0, float y0,
                       float apart);

}  // namespace tutti::internal
