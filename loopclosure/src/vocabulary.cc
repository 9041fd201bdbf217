#include "tutti/loopclosure/vocabulary.h"

#include <algorithm>
#include <cmath>

#include "distances.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/parallel.h"

namespace tutti {
namespace {

// The two nearest of the first `count` rows of `created`, exactly, merged into `best`.
void OfferCreated(const cv::Mat& descriptors, int i, const cv::Mat& created, int count, int first_word,
                  std::vector<float>& distances, TwoNearest& best) {
  const bool binary = descriptors.depth() == CV_8U;
  if (binary) {
    internal::HammingDistances(descriptors.ptr(i), created.ptr(), count, created.cols, created.step[0],
                               distances.data());
  } else {
    internal::SquaredDistances(descriptors.ptr<float>(i), created.ptr<float>(), count, created.cols,
                               created.step1(), distances.data());
  }
  for (int k = 0; k < count; ++k) {
    const float distance =
        binary ? distances[static_cast<std::size_t>(k)] : std::sqrt(distances[static_cast<std::size_t>(k)]);
    if (distance < best.second_distance) best.Offer(first_word + k, distance);
  }
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
  std::vector<float> distances(nearest.size());
  words.reserve(nearest.size());
  for (int i = 0; i < descriptors.rows; ++i) {
    TwoNearest best = nearest[static_cast<std::size_t>(i)];
    OfferCreated(descriptors, i, created, num_created, old_words, distances, best);
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
