#include "loopclosure/vocabulary/vocabulary.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/numbers.h"
#include "core/parallel.h"
#include "core/state_archive.h"
#include "loopclosure/features/whole_rows.h"
#include "loopclosure/vocabulary/word_storage.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

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
  // Trees and leaves are FLANN's defaults: half of the leaves find a tenth fewer of the nearest words.
  constexpr int kTries = 5, kTrees = 4, kLeaves = 32;
  if (type_ == CV_8U) {
    index_ = MakeHammingIndex(width_, kTries, seed_);
  } else if (options_.float_index == FloatIndex::kFlann) {
    index_ = MakeFlannIndex(width_, kTrees, kLeaves, seed_);
  } else {
    index_ = MakeKdForestIndex(width_, kTrees, kLeaves, seed_);
  }
}

std::vector<int> Vocabulary::Quantise(const cv::Mat& descriptors, int threads) {
  if (descriptors.rows == 0) return {};
  std::vector<TwoNearest> nearest(internal::Index(descriptors.rows));
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
  std::vector<int> created;  // rows that became words
  internal::RowDistances among_themselves(descriptors, descriptors);
  words.reserve(nearest.size());
  for (int i = 0; i < descriptors.rows; ++i) {
    TwoNearest best = nearest[internal::Index(i)];
    const std::vector<float>& squares = among_themselves.To(i, i);
    for (std::size_t k = 0; k < created.size(); ++k) {
      const float distance = std::sqrt(squares[internal::Index(created[k])]) / among_themselves.scale();
      if (distance < best.second_distance) best.Offer(old_words + static_cast<int>(k), distance);
    }
    if (IsNew(best)) {
      words.push_back(old_words + static_cast<int>(created.size()));
      created.push_back(i);
    } else {
      words.push_back(best.first);
    }
  }
  if (!created.empty()) {
    std::vector<int> ids(created.size());
    std::iota(ids.begin(), ids.end(), old_words);
    cv::Mat rows(0, width_, type_);
    rows.reserve(created.size());
    for (const int i : created) rows.push_back(descriptors.row(i));
    index_->Add(ids, rows);
    created_ += static_cast<int>(created.size());
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

template <class Archive>
void Vocabulary::Beside::State(Archive& archive) {
  static_assert(kMostWords == internal::WordStorage::kMostWords);
  constexpr int kMostColumns = 1 << 16;
  Vocabulary& v = *vocabulary;
  std::vector<int> words, references;
  v.references_.ForEach([&](int word, int count) {
    words.push_back(word);
    references.push_back(count);
  });
  archive(v.type_, v.width_, v.created_, internal::GrowingNumbers{&words},
          internal::SmallNumbers{&references});
  if constexpr (Archive::kReading) {
    if (v.type_ != -1 && v.type_ != CV_32F && v.type_ != CV_8U)
      archive.Damaged("descriptors of an unknown type");
    if (v.type_ != -1 && (v.width_ <= 0 || v.width_ > kMostColumns))
      archive.Damaged("descriptors of an impossible width");
    if (v.created_ < 0 || v.created_ > kMostWords) archive.Damaged("an impossible number of words");
    if (!words.empty() && words.back() >= v.created_) archive.Damaged("a word that was never made");
    if (words.size() != references.size()) archive.Damaged("words without locations");
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (references[i] < 1 || references[i] > kMostWords) archive.Damaged("a word without a location");
      v.references_[words[i]] = references[i];
    }
    if (v.type_ != -1) v.MakeIndex();
  }
  if (v.index_) v.index_->State(archive, known);
  if constexpr (Archive::kReading) {
    if (v.size() > v.created_) archive.Damaged("more words than were ever made");
  }
}

template void Vocabulary::Beside::State(internal::StateWriter& archive);
template void Vocabulary::Beside::State(internal::StateReader& archive);

}  // namespace tutti
