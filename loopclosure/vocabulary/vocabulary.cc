#include "loopclosure/vocabulary/vocabulary.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/byte_stream.h"
#include "loopclosure/detector/parallel.h"
#include "loopclosure/vocabulary/distances.h"
#include "loopclosure/vocabulary/word_storage.h"
#include "tutti/core/error.h"

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

std::string Vocabulary::Problem(const cv::Mat& descriptors) const {
  if (descriptors.rows == 0) return {};
  if (descriptors.type() != CV_32F && descriptors.type() != CV_8U) {
    return "descriptors must be CV_32F (Euclidean) or CV_8U (Hamming), one row each";
  }
  if (type_ < 0 || (descriptors.type() == type_ && descriptors.cols == width_)) return {};
  return "descriptors are " + TypeName(descriptors.type(), descriptors.cols) +
         " but this vocabulary was started with " + TypeName(type_, width_) +
         "; give every image the same kind";
}

void Vocabulary::CheckType(const cv::Mat& descriptors) {
  const std::string problem = Problem(descriptors);
  if (!problem.empty()) throw InputError(problem);
  if (type_ >= 0 || descriptors.rows == 0) return;
  type_ = descriptors.type();
  width_ = descriptors.cols;
  MakeIndex();
}

void Vocabulary::MakeIndex() {
  if (type_ == CV_8U) {
    index_ = MakeHammingIndex(width_, options_.hash_tables, seed_);
  } else if (options_.float_index == FloatIndex::kFlann) {
    index_ = MakeFlannIndex(width_, options_.trees, options_.checks, seed_);
  } else {
    index_ = MakeKdForestIndex(width_, options_.trees, options_.checks, seed_);
  }
}

std::vector<int> Vocabulary::Quantise(const cv::Mat& descriptors, int threads) {
  if (descriptors.rows == 0) return {};
  std::vector<TwoNearest> nearest(static_cast<std::size_t>(descriptors.rows));
  constexpr int kBlock = 50;
  RunParallel((descriptors.rows + kBlock - 1) / kBlock, threads, [&](int block) {
    Search(descriptors, block * kBlock, std::min(descriptors.rows, (block + 1) * kBlock), nearest);
  });
  return Assign(descriptors, nearest);
}

void Vocabulary::Search(const cv::Mat& descriptors, int begin, int end,
                        std::vector<TwoNearest>& nearest) const {
  if (!index_ || !Problem(descriptors).empty()) return;  // Assign throws
  const std::vector<TwoNearest> found = index_->Search(descriptors.rowRange(begin, end));
  std::copy(found.begin(), found.end(), nearest.begin() + begin);
}

std::vector<int> Vocabulary::Recognise(const std::vector<TwoNearest>& nearest) const {
  std::vector<int> words;
  words.reserve(nearest.size());
  for (const TwoNearest& best : nearest) words.push_back(IsNew(best) ? -1 : best.first);
  return words;
}

std::vector<int> Vocabulary::Assign(const cv::Mat& descriptors, const std::vector<TwoNearest>& nearest) {
  std::vector<int> words;
  if (descriptors.rows == 0) return words;
  CheckType(descriptors);
  const int old_words = created_;
  cv::Mat created(descriptors.rows, width_, type_);
  int num_created = 0;
  std::vector<float> distances(nearest.size());
  words.reserve(nearest.size());
  for (int i = 0; i < descriptors.rows; ++i) {
    TwoNearest best = nearest[static_cast<std::size_t>(i)];
    OfferCreated(descriptors, i, created, num_created, old_words, distances, best);
    if (IsNew(best)) {
      descriptors.row(i).copyTo(created.row(num_created));
      words.push_back(old_words + num_created++);
    } else {
      words.push_back(best.first);
    }
  }
  if (num_created > 0) {
    std::vector<int> ids(static_cast<std::size_t>(num_created));
    std::iota(ids.begin(), ids.end(), old_words);
    index_->Add(ids, created.rowRange(0, num_created));
    created_ += num_created;
  }
  return words;
}

void Vocabulary::AddReferences(const Signature& signature) {
  for (const Signature::Entry& entry : signature.entries()) ++references_[entry.word];
}

void Vocabulary::RemoveReferences(const Signature& signature) {
  for (const Signature::Entry& entry : signature.entries()) {
    int* count = references_.Find(entry.word);
    if (count == nullptr || --*count > 0) continue;
    references_.Erase(entry.word);
    index_->Remove(entry.word);
  }
}

std::vector<int> Vocabulary::WordsOnlyIn(const Signature& signature) const {
  std::vector<int> words;
  for (const Signature::Entry& entry : signature.entries()) {
    const int* count = references_.Find(entry.word);
    if (count != nullptr && *count == 1) words.push_back(entry.word);
  }
  return words;
}

std::vector<int> Vocabulary::Missing(const Signature& signature) const {
  std::vector<int> words;
  for (const Signature::Entry& entry : signature.entries()) {
    if (!Has(entry.word)) words.push_back(entry.word);
  }
  return words;
}

void Vocabulary::Restore(const std::vector<int>& words, const cv::Mat& descriptors) {
  if (words.empty()) return;
  CheckType(descriptors);
  index_->Add(words, descriptors);
  created_ = std::max(created_, *std::max_element(words.begin(), words.end()) + 1);
}

cv::Mat Vocabulary::Descriptor(int word) const {
  const std::uint8_t* data = index_ ? index_->Find(word) : nullptr;
  if (data == nullptr) return {};
  cv::Mat row(1, width_, type_);
  std::copy_n(data, row.elemSize() * row.total(), row.data);
  return row;
}

void Vocabulary::Save(const std::vector<internal::PackedMat>& known, internal::ByteWriter& out) const {
  out.Put<std::int32_t>(type_);
  out.Put<std::int32_t>(width_);
  out.Put<std::int32_t>(created_);
  out.Put<std::uint64_t>(references_.size());
  int before = -1;
  references_.ForEach([&](int word, int count) {
    out.PutVarint(static_cast<std::uint64_t>(word - before - 1));
    out.PutVarint(static_cast<std::uint64_t>(count));
    before = word;
  });
  if (index_) index_->Save(known, out);
}

void Vocabulary::Load(const std::vector<internal::PackedMat>& known, internal::ByteReader& in) {
  static_assert(kMostWords == internal::WordStorage::kMostWords);
  constexpr int kMostColumns = 1 << 16;
  type_ = in.Get<std::int32_t>();
  width_ = in.Get<std::int32_t>();
  created_ = in.Get<std::int32_t>();
  if (type_ != -1 && type_ != CV_32F && type_ != CV_8U) in.Damaged("descriptors of an unknown type");
  if (type_ != -1 && (width_ <= 0 || width_ > kMostColumns)) in.Damaged("descriptors of an impossible width");
  if (created_ < 0 || created_ > kMostWords) in.Damaged("an impossible number of words");
  const std::size_t count = in.GetCount(2);
  int word = -1;
  for (std::size_t i = 0; i < count; ++i) {
    word += 1 + in.GetVarintIndex(created_ - 1 - word);
    const int references = in.GetVarintIndex(kMostWords + 1);
    if (references < 1) in.Damaged("a word without a location");
    references_[word] = references;
  }
  if (type_ == -1) return;
  MakeIndex();
  index_->Load(known, in);
  if (index_->size() > created_) in.Damaged("more words than were ever made");
}

}  // namespace tutti
