#include "loopclosure/features/distances.h"

#include <limits>

#include "core/inner_loops.h"

namespace tutti::internal {

TUTTI_CLONES("avx2")
TUTTI_CHECKED_AS_A_WHOLE void SquaredDistances(const float* query, const float* rows, int count,
                                               int dimensions, std::size_t step, float* distances) {
  if (count > 0) {
    CheckReadable(query, static_cast<std::size_t>(dimensions));
    CheckReadable(rows, static_cast<std::size_t>(count - 1) * step + static_cast<std::size_t>(dimensions));
    CheckWritable(distances, static_cast<std::size_t>(count));
  }
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
TUTTI_CHECKED_AS_A_WHOLE void HammingDistances(const std::uint8_t* query, const std::uint8_t* rows, int count,
                                               int bytes, std::size_t step, float* distances) {
  if (count > 0) {
    CheckReadable(query, static_cast<std::size_t>(bytes));
    CheckReadable(rows, static_cast<std::size_t>(count - 1) * step + static_cast<std::size_t>(bytes));
    CheckWritable(distances, static_cast<std::size_t>(count));
  }
  if (bytes == 32) {  // ORB: a fixed length unrolls
    for (int j = 0; j < count; ++j) {
      distances[j] =
          static_cast<float>(HammingDistance(query, rows + static_cast<std::size_t>(j) * step, 32));
    }
    return;
  }
  for (int j = 0; j < count; ++j) {
    distances[j] =
        static_cast<float>(HammingDistance(query, rows + static_cast<std::size_t>(j) * step, bytes));
  }
}

TUTTI_CLONES("avx2")
TUTTI_CHECKED_AS_A_WHOLE float UpdateNearest(const float* distances, int count, int row, float* nearest,
                                             std::int32_t* nearest_row) {
  CheckReadable(distances, static_cast<std::size_t>(count));
  CheckWritable(nearest, static_cast<std::size_t>(count));
  CheckWritable(nearest_row, static_cast<std::size_t>(count));
  // Floats that are not negative are ordered as their bits are, and integers need no order of evaluation.
  std::int32_t least = std::numeric_limits<std::int32_t>::max();
  for (int j = 0; j < count; ++j) {
    std::int32_t bits = 0;
    std::memcpy(&bits, distances + j, sizeof bits);
    least = bits < least ? bits : least;
  }
  for (int j = 0; j < count; ++j) {
    const bool nearer = distances[j] < nearest[j];
    nearest[j] = nearer ? distances[j] : nearest[j];
    nearest_row[j] = nearer ? row : nearest_row[j];
  }
  float result = 0;
  std::memcpy(&result, &least, sizeof result);
  return result;
}

TUTTI_CLONES("avx2")
TUTTI_CHECKED_AS_A_WHOLE float NearestElsewhere(const float* distances, const float* x, const float* y,
                                                int count, float x0, float y0, float apart) {
  CheckReadable(distances, static_cast<std::size_t>(count));
  CheckReadable(x, static_cast<std::size_t>(count));
  CheckReadable(y, static_cast<std::size_t>(count));
  const float most = std::numeric_limits<float>::infinity();
  const float square = apart * apart;
  std::int32_t least = 0;
  std::memcpy(&least, &most, sizeof least);
  for (int j = 0; j < count; ++j) {
    const float dx = x[j] - x0, dy = y[j] - y0;
    const float distance = dx * dx + dy * dy > square ? distances[j] : most;
    std::int32_t bits = 0;
    std::memcpy(&bits, &distance, sizeof bits);
    least = bits < least ? bits : least;
  }
  float result = 0;
  std::memcpy(&result, &least, sizeof result);
  return result;
}

}  // namespace tutti::internal
