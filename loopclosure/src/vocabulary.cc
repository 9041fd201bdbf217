#include "tutti/loopclosure/vocabulary.h"

#include <cmath>

#include "hamming.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/parallel.h"

namespace tutti {
namespace {

// True distance of two descriptors of the given type.
TUTTI_POPCOUNT_CLONES float TrueDistance(const cv::Mat& a, int i, const cv::Mat& b, int j) {
  if (a.depth() == CV_8U) {
    return static_cast<float>(internal::HammingDistance(a.ptr(i), b.ptr(j), a.cols));
  }
  const float* x = a.ptr<float>(i);
  const float* y = b.ptr<float>(j);
  // Eight sums side by side, so that the compiler may vectorise without reordering a sum.
  float sums[8] = {};
  int k = 0;
  for (; k + 8 <= a.cols; k += 8) {
    for (int l = 0; l < 8; ++l) {
      const float d = x[k + l] - y[k + l];
      sums[l] += d * d;
    }
  }
  float sum = ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
  for (; k < a.cols; ++k) sum += (x[k] - y[k]) * (x[k] - y[k]);
  return std::sqrt(sum);
}

std::string TypeName(int type, int width) {
  return (type == CV_32F  ? "CV_32F x "
          : type == CV_8U ? "CV_8U x "
                          : "another type x ") +
         std::to_string(width);
}

}  // namespace

void Vocabulary::CheckType(const cv::Mat& descriptors) {
  if (type_ < 0) {
    if (descriptors.type() != CV_32F && descriptors.type() != CV_8U) {
      throw InputError("descriptors must be CV_32F (Euclidean) or CV_8U (Hamming), one row each");
    }
    type_ = descriptors.type();
    width_ = descriptors.cols;
    index_ = type_ == CV_32F ? MakeKdForestIndex(width_, options_.trees, options_.checks, seed_)
                             : MakeHammingIndex(width_, options_.hash_tables, seed_);
  }
  if (descriptors.type() != type_ || descriptors.cols != width_) {
    throw InputError("descriptors are " + TypeName(descriptors.type(), descriptors.cols) +
                     " but this vocabulary was started with " + TypeName(type_, width_) +
                     "; give every image the same kind");
  }
}

std::vector<int> Vocabulary::Quantise(const cv::Mat& descriptors, int threads) {
  std::vector<int> words;
  if (descriptors.rows == 0) return words;
  CheckType(descriptors);

  std::vector<TwoNearest> nearest(static_cast<std::size_t>(descriptors.rows));
  constexpr int kBlock = 50;
  RunParallel((descriptors.rows + kBlock - 1) / kBlock, threads, [&](int block) {
    for (int i = block * kBlock; i < std::min(descriptors.rows, (block + 1) * kBlock); ++i) {
      nearest[static_cast<std::size_t>(i)] = index_->Search(descriptors.ptr(i));
    }
  });

  const int old_words = index_->size();
  cv::Mat created(descriptors.rows, width_, type_);
  int num_created = 0;
  words.reserve(nearest.size());
  for (int i = 0; i < descriptors.rows; ++i) {
    TwoNearest best = nearest[static_cast<std::size_t>(i)];
    for (int k = 0; k < num_created; ++k) best.Offer(old_words + k, TrueDistance(descriptors, i, created, k));
    const bool is_new = best.second < 0 || best.first_distance > options_.nndr * best.second_distance;
    if (is_new) {
      descriptors.row(i).copyTo(created.row(num_created));
      words.push_back(old_words + num_created++);
    } else {
      words.push_back(best.first);
    }
  }
  if (num_created > 0) index_->Add(created.rowRange(0, num_created).clone());
  return words;
}

}  // namespace tutti
