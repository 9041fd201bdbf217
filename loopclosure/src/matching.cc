#include "tutti/loopclosure/matching.h"

#include <cmath>
#include <limits>

#include "hamming.h"

// Compiled twice, for plain x86-64 and for AVX2, chosen at run time. No fused multiply-add: both give the
// same bits.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define TUTTI_AVX2_CLONES __attribute__((target_clones("default", "avx2")))
#else
#define TUTTI_AVX2_CLONES
#endif

namespace tutti {
namespace {

constexpr float kSamePlace = 4.0f;  // [px]
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Squared distances of one row to all rows. `dimensions` is a multiple of 8; the rest is padding.
TUTTI_AVX2_CLONES void SquaredDistances(const float* query, const float* rows, int count, int dimensions,
                                        std::size_t step, float* distances) {
  for (int j = 0; j < count; ++j) {
    const float* row = rows + static_cast<std::size_t>(j) * step;
    float sums[8] = {};
    for (int k = 0; k < dimensions; k += 8) {
      for (int l = 0; l < 8; ++l) {
        const float d = query[k + l] - row[k + l];
        sums[l] += d * d;
      }
    }
    distances[j] = ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
  }
}

TUTTI_POPCOUNT_CLONES void HammingDistances(const std::uint8_t* query, const std::uint8_t* rows, int count,
                                            int bytes, std::size_t step, float* distances) {
  for (int j = 0; j < count; ++j) {
    const float bits = static_cast<float>(
        internal::HammingDistance(query, rows + static_cast<std::size_t>(j) * step, bytes));
    distances[j] = bits * bits;
  }
}

// A copy whose rows are padded with zeros to a multiple of 8 columns, if they are not already.
cv::Mat Padded(const cv::Mat& rows) {
  if (rows.cols % 8 == 0) return rows;
  cv::Mat padded = cv::Mat::zeros(rows.rows, (rows.cols + 7) / 8 * 8, rows.type());
  rows.copyTo(padded.colRange(0, rows.cols));
  return padded;
}

}  // namespace

std::vector<Match> MatchDescriptors(const cv::Mat& query, const cv::Mat& candidate,
                                    const std::vector<cv::Point2f>& candidate_points, double max_ratio) {
  std::vector<Match> matches;
  if (query.empty() || candidate.empty() || query.type() != candidate.type() ||
      query.cols != candidate.cols || (query.type() != CV_32F && query.type() != CV_8U) ||
      candidate_points.size() != static_cast<std::size_t>(candidate.rows)) {
    return matches;
  }
  const bool binary = query.type() == CV_8U;
  const cv::Mat q = binary ? query : Padded(query);
  const cv::Mat c = binary ? candidate : Padded(candidate);
  const std::size_t count = static_cast<std::size_t>(c.rows);
  std::vector<float> distances(count);
  std::vector<float> best_of_candidate(count, kInfinity);
  std::vector<int> query_of_candidate(count, -1);
  for (int i = 0; i < q.rows; ++i) {
    if (binary) {
      HammingDistances(q.ptr(i), c.ptr(), c.rows, c.cols, c.step[0], distances.data());
    } else {
      SquaredDistances(q.ptr<float>(i), c.ptr<float>(), c.rows, c.cols, c.step1(), distances.data());
    }
    std::size_t best = 0;
    for (std::size_t j = 0; j < count; ++j) {
      if (distances[j] < distances[best]) best = j;
      if (distances[j] < best_of_candidate[j]) {
        best_of_candidate[j] = distances[j];
        query_of_candidate[j] = i;
      }
    }
    float second = kInfinity;
    for (std::size_t j = 0; j < count; ++j) {
      if (distances[j] >= second) continue;
      const cv::Point2f apart = candidate_points[j] - candidate_points[best];
      if (apart.dot(apart) > kSamePlace * kSamePlace) second = distances[j];
    }
    const float ratio = second > 0.0f ? std::sqrt(distances[best] / second) : 1.0f;
    if (ratio <= max_ratio) matches.push_back({i, static_cast<int>(best), ratio});
  }
  std::vector<Match> mutual;
  for (const Match& match : matches) {
    if (query_of_candidate[static_cast<std::size_t>(match.candidate)] == match.query) mutual.push_back(match);
  }
  return mutual;
}

}  // namespace tutti
