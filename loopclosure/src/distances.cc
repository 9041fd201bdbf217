#include "distances.h"

namespace tutti::internal {

TUTTI_CLONES("avx2")
void SquaredDistances(const float* query, const float* rows, int count, int dimensions, std::size_t step,
                      float* distances) {
  for (int j = 0; j < count; ++j) {
    const float* row = rows + static_cast<std::size_t>(j) * step;
    float sums[16] = {};
    int k = 0;
    for (; k + 16 <= dimensions; k += 16) {
      for (int l = 0; l < 16; ++l) {
        const float d = query[k + l] - row[k + l];
        sums[l] += d * d;
      }
    }
    float sum = 0.0f;
    for (; k < dimensions; ++k) sum += (query[k] - row[k]) * (query[k] - row[k]);
    for (int l = 0; l < 8; ++l) sums[l] += sums[l + 8];
    for (int l = 0; l < 4; ++l) sums[l] += sums[l + 4];
    distances[j] = ((sums[0] + sums[2]) + (sums[1] + sums[3])) + sum;
  }
}

TUTTI_CLONES("popcnt")
void HammingDistances(const std::uint8_t* query, const std::uint8_t* rows, int count, int bytes,
                      std::size_t step, float* distances) {
  for (int j = 0; j < count; ++j) {
    distances[j] =
        static_cast<float>(HammingDistance(query, rows + static_cast<std::size_t>(j) * step, bytes));
  }
}

}  // namespace tutti::internal
