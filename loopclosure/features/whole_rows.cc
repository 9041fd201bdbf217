#include "loopclosure/features/whole_rows.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/inner_loops.h"
#include "core/numbers.h"
#include "loopclosure/features/distances.h"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#endif

namespace tutti::internal {
namespace {

constexpr int kTogether = WholeRows::kTogether;
constexpr std::size_t kRowBlock = 16;  // columns whose sums stay in registers

// Scalar products of kTogether rows (`pairs` pairs of values each, row by row) with `padded` columns.
struct Task {
  const std::int16_t* rows;
  const std::int16_t* columns;
  std::size_t pairs, padded;
  std::int32_t* products;  // padded of the first row, then of the next
};

void Check(const Task& t) {
  CheckReadable(t.rows, kTogether * 2 * t.pairs);
  CheckReadable(t.columns, 2 * t.pairs * t.padded);
  CheckWritable(t.products, kTogether * t.padded);
}

TUTTI_CHECKED_AS_A_WHOLE void MultiplyAnywhere(const Task& t) {
  for (std::size_t c = 0; c < t.padded; c += kRowBlock) {
    std::int32_t sums[kTogether][kRowBlock] = {};
    for (std::size_t k = 0; k < t.pairs; ++k) {
      const std::int16_t* column = t.columns + 2 * (k * t.padded + c);
      for (std::size_t i = 0; i < kTogether; ++i) {
        const std::int16_t* row = t.rows + 2 * (i * t.pairs + k);
        for (std::size_t l = 0; l < kRowBlock; ++l)
          sums[i][l] += row[0] * column[2 * l] + row[1] * column[2 * l + 1];
      }
    }
    for (std::size_t i = 0; i < kTogether; ++i)
      std::copy_n(sums[i], kRowBlock, t.products + i * t.padded + c);
  }
}

#if defined(__x86_64__) && defined(__GNUC__)
#define TUTTI_BY_AVX2 __attribute__((target("avx2"))) TUTTI_CHECKED_AS_A_WHOLE
// It gives the numbers of MultiplyAnywhere. What target_clones would have to find by itself: one instruction
// multiplies two pairs and adds them up.
TUTTI_BY_AVX2 void MultiplyByAvx2(const Task& t) {
  static_assert(kTogether == 4 && kRowBlock == 16);
  for (std::size_t c = 0; c < t.padded; c += kRowBlock) {
    __m256i sums[kTogether][2];
    for (auto& sum : sums) sum[0] = sum[1] = _mm256_setzero_si256();
    for (std::size_t k = 0; k < t.pairs; ++k) {
      const std::int16_t* column = t.columns + 2 * (k * t.padded + c);
      const __m256i left = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(column));
      const __m256i right = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(column + kRowBlock));
      for (std::size_t i = 0; i < kTogether; ++i) {
        std::int32_t pair = 0;
        std::memcpy(&pair, t.rows + 2 * (i * t.pairs + k), sizeof pair);
        const __m256i row = _mm256_set1_epi32(pair);
        sums[i][0] = _mm256_add_epi32(sums[i][0], _mm256_madd_epi16(left, row));
        sums[i][1] = _mm256_add_epi32(sums[i][1], _mm256_madd_epi16(right, row));
      }
    }
    for (std::size_t i = 0; i < kTogether; ++i) {
      std::int32_t* to = t.products + i * t.padded + c;
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), sums[i][0]);
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(to + kRowBlock / 2), sums[i][1]);
    }
  }
}
#endif

// False if a value times `scale` is no whole number of 16 bits.
TUTTI_CLONES("avx2")
TUTTI_CHECKED_AS_A_WHOLE bool Round(const float* from, std::size_t count, float scale, std::int16_t* to) {
  constexpr float kMost = 32767.0f;
  CheckReadable(from, count);
  CheckWritable(to, count);
  std::int32_t others = 0;
  for (std::size_t c = 0; c < count; ++c) {
    const float value = from[c] * scale;
    const bool fits = std::abs(value) <= kMost;  // a NaN does not
    const auto whole = static_cast<std::int32_t>(fits ? value : 0.0f);
    others |=
        static_cast<std::int32_t>(!fits) | static_cast<std::int32_t>(static_cast<float>(whole) != value);
    to[c] = static_cast<std::int16_t>(whole);
  }
  return others == 0;
}

void Multiply(const Task& task) {
  Check(task);
#if defined(__x86_64__) && defined(__GNUC__)
  if (__builtin_cpu_supports("avx2")) return MultiplyByAvx2(task);
#endif
  MultiplyAnywhere(task);
}

}  // namespace

std::optional<WholeRows> WholeRows::Of(const cv::Mat& rows, float scale) {
  constexpr std::int64_t kLongest = 1 << 29;  // (a - b)^2 <= 4 max(a^2, b^2)
  WholeRows whole;
  const auto count = Index(rows.rows), width = Index(rows.cols);
  whole.pairs_ = static_cast<int>((width + 1) / 2);
  whole.values_.resize((count + kTogether - 1) * 2 * Index(whole.pairs_));
  for (std::size_t r = 0; r < count; ++r) {
    const float* from = rows.ptr<float>(static_cast<int>(r));
    std::int16_t* to = whole.values_.data() + r * 2 * Index(whole.pairs_);
    const bool all = Round(from, width, scale, to);
    std::int64_t square = 0;
    for (std::size_t c = 0; c < width; ++c) square += to[c] * to[c];
    if (!all || square >= kLongest) return std::nullopt;
    whole.squares_.push_back(static_cast<std::int32_t>(square));
  }
  return whole;
}

WholeRows::Columns::Columns(const WholeRows& rows)
    : padded_((rows.squares_.size() + kRowBlock - 1) / kRowBlock * kRowBlock),
      values_(2 * Index(rows.pairs_) * padded_),
      squares_(rows.squares_) {
  const auto pairs = Index(rows.pairs_);
  for (std::size_t r = 0; r < squares_.size(); ++r) {
    const std::int16_t* from = rows.values_.data() + r * 2 * pairs;
    for (std::size_t k = 0; k < pairs; ++k) {
      std::int16_t* to = values_.data() + 2 * (k * padded_ + r);
      to[0] = from[2 * k];
      to[1] = from[2 * k + 1];
    }
  }
}

void WholeRows::Distances(int first, const Columns& others, Block& distances) const {
  const auto begin = Index(first), pairs = Index(pairs_);
  std::vector<std::int32_t> products(kTogether * others.padded_);
  Multiply(
      {values_.data() + begin * 2 * pairs, others.values_.data(), pairs, others.padded_, products.data()});
  for (std::size_t i = 0; i < distances.size() && begin + i < squares_.size(); ++i) {
    const std::int32_t* product = products.data() + i * others.padded_;
    float* to = distances[i].data();
    const auto square = static_cast<std::uint32_t>(squares_[begin + i]);
    for (std::size_t j = 0; j < others.squares_.size(); ++j) {  // on the way it may wrap around
      const std::uint32_t sum = square + static_cast<std::uint32_t>(others.squares_[j]) -
                                2U * static_cast<std::uint32_t>(product[j]);
      to[j] = static_cast<float>(static_cast<std::int32_t>(sum));
    }
  }
}

RowDistances::RowDistances(const cv::Mat& query, const cv::Mat& candidate)
    : query_(query), candidate_(candidate) {
  for (std::vector<float>& distances : distances_) distances.resize(Index(candidate.rows));
  if (query.type() != CV_32F) return;
  for (const float scale : {1.0f, WholeRows::kSignedSquares}) {
    whole_query_ = WholeRows::Of(query, scale);
    const std::optional<WholeRows> whole = whole_query_ ? WholeRows::Of(candidate, scale) : std::nullopt;
    if (!whole) continue;
    columns_.emplace(*whole);
    scale_ = scale;
    return;
  }
}

const std::vector<float>& RowDistances::To(int i, int count) {
  if (columns_) {
    if (i % kTogether == 0) whole_query_->Distances(i, *columns_, distances_);
    return distances_.at(Index(i % kTogether));
  }
  std::vector<float>& distances = distances_.front();
  if (query_.type() == CV_32F) {
    SquaredDistances(query_.ptr<float>(i), candidate_.ptr<float>(), count, candidate_.cols,
                     candidate_.step1(), distances.data());
    return distances;
  }
  HammingDistances(query_.ptr(i), candidate_.ptr(), count, candidate_.cols, candidate_.step[0],
                   distances.data());
  for (float& distance : distances) distance *= distance;
  return distances;
}

}  // namespace tutti::internal
