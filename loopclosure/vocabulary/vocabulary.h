// One member's incremental visual vocabulary: descriptors in, word ids out.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "loopclosure/store/packed_mat.h"
#include "loopclosure/vocabulary/descriptor_index.h"
#include "loopclosure/vocabulary/signature.h"
#include "loopclosure/vocabulary/word_map.h"
#include "tutti/loopclosure/detector_options.h"

namespace tutti {

/// Incremental vocabulary, no training and no file (loop-closure.md section 3; Labbe & Michaud 2013, section
/// III-A).
///
/// A descriptor becomes a new word if it has fewer than two neighbours or d1 > nndr * d2, on true distance,
/// where the neighbours come from the index and, exactly, from the words that this same image has just
/// created. The index grows by insertion after each image.
///
/// Words live as long as a location in memory refers to them: AddReferences and RemoveReferences count.
/// A word whose last reference goes leaves the index; Restore brings it back under its old id.
class Vocabulary {
 public:
  /// Words that a vocabulary may ever create; a saved one with more is damaged. Small enough for the naive
  /// rule, which multiplies word ids by the number of members.
  static constexpr int kMostWords = 1 << 28;

  /// Empty; the first descriptors settle type and width. `seed`: of the index.
  Vocabulary(const VocabularyOptions& options, std::uint64_t seed) : options_(options), seed_(seed) {}

  /// Words of N descriptors (CV_32F: Euclidean, CV_8U: Hamming), one per row, in row order; new ones are
  /// added. The search runs on up to `threads` threads, with the same result for any number. Throws
  /// InputError for another type or width than before.
  std::vector<int> Quantise(const cv::Mat& descriptors, int threads = 1);

  /// Quantise in two steps, for callers that spread the first over threads: the two nearest words of rows
  /// begin .. end - 1, into nearest[begin] .. (size N); then the words, of which new ones are added. Search
  /// is safe to call from several threads at once.
  void Search(const cv::Mat& descriptors, int begin, int end, std::vector<TwoNearest>& nearest) const;
  /// The second step: a word for each of N descriptors, of which `nearest` (size N) holds what Search found.
  std::vector<int> Assign(const cv::Mat& descriptors, const std::vector<TwoNearest>& nearest);
  /// The words of what Search found that Assign would not make new, -1 for the others: nothing is added.
  std::vector<int> Recognise(const std::vector<TwoNearest>& nearest) const;

  /// One more location that has these words.
  void AddReferences(const Signature& signature);
  /// One location less; words that no location has any more leave the index.
  void RemoveReferences(const Signature& signature);
  /// Words that no other location refers to: they would leave with this one.
  std::vector<int> WordsOnlyIn(const Signature& signature) const;
  /// Words of a signature that are not in the index.
  std::vector<int> Missing(const Signature& signature) const;
  /// Brings words back that had left, one descriptor row each. Throws InputError for another type or width.
  void Restore(const std::vector<int>& words, const cv::Mat& descriptors);

  /// Empty if descriptors of this type and width fit, else what is wrong.
  std::string Problem(const cv::Mat& descriptors) const;

  /// True if the word is in the index.
  bool Has(int word) const { return index_ && index_->Find(word) != nullptr; }
  /// A word's descriptor, 1 x D; empty if the word is not in the index.
  cv::Mat Descriptor(int word) const;
  /// Words in the index.
  int size() const { return index_ ? index_->size() : 0; }
  /// Words ever created; ids are 0 .. created() - 1.
  int created() const { return created_; }
  /// Ids below this are taken, wherever their words may be.
  void SkipIds(int created) { created_ = std::max(created_, created); }

  /// The state beside `known`: descriptors that whoever loads it has, too, and in the same order; a word that
  /// is among them takes a few bytes.
  struct Beside {
    Vocabulary* vocabulary;
    std::vector<internal::PackedMat> known;

    template <class Archive>
    void State(Archive& archive);
  };

 private:
  void CheckType(const cv::Mat& descriptors);
  void MakeIndex();
  bool IsNew(const TwoNearest& nearest) const {
    return nearest.second < 0 || nearest.first_distance > options_.nndr * nearest.second_distance;
  }

  VocabularyOptions options_;
  std::uint64_t seed_;
  int type_ = -1;
  int width_ = 0;
  int created_ = 0;
  std::unique_ptr<DescriptorIndex> index_;
  WordMap<int> references_;  // locations that have a word
};

}  // namespace tutti
