// p(L_t | S_t): how much an image looks like each location, and how much it looks like none of them.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "core/numbers.h"
#include "loopclosure/memory/belief.h"
#include "loopclosure/vocabulary/signature.h"
#include "loopclosure/vocabulary/word_map.h"
#include "tutti/loopclosure/detector_options.h"

namespace tutti {

/// What a member sees in an image: its words and where they were seen, the cell of each feature in a grid of
/// kColumns cells along the longer side of the image; or, a dense member, its descriptor.
struct SeenWords {
  static constexpr int kColumns = 8;       ///< cells along the longer side
  static constexpr int kStripColumns = 2;  ///< that make an upright strip of the image
  std::vector<int> words;                  ///< one for each feature; -1: not known
  std::vector<int> cells;                  ///< likewise
  cv::Mat descriptor;  ///< of a dense member, in place of words: 1 x D of length 1, or empty

  /// The cell of a pixel, row by row.
  static int Cell(const cv::Point2f& pixel, const cv::Size& size);
  /// Number of words that are known.
  int size() const;
  /// size(), with a number that stands for a descriptor.
  double Amount() const;
};

/// That a slot has a word, and how often.
struct Posting {
  int slot = 0;
  int count = 0;
};

/// Which words are no sign of a return to a slot, since they have been in sight in between: those seen in a
/// quarter of the images after it, and in two at least. What moves along (another vehicle, dirt on the lens,
/// the horizon) would otherwise know the places of before in every image; it may be hidden for a while.
struct Sight {
  int settled = 0;  ///< holds for slots before this, the oldest one in STM; 0: every word counts

  /// Calls call(posting) for each of a word's postings (ascending by slot, none after `newest`, which has the
  /// word) but those of slots since which it has been in sight.
  template <typename Call>
  void ForEachReturn(const std::vector<Posting>& postings, int newest, const Call& call) const {
    constexpr int kLeast = 2;  // images in between that have the word
    constexpr int kOneIn = 4;  // of so many
    int between = postings.empty() || postings.back().slot < newest ? 0 : -1;  // images that have it
    for (auto posting = postings.rbegin(); posting != postings.rend(); ++posting, ++between) {
      const int since = newest - posting->slot - 1;
      const bool in_sight = between >= kLeast && kOneIn * between >= since;
      if (!in_sight || posting->slot >= settled) call(*posting);
    }
  }
};

/// Inverted index over the signatures of all locations in STM and WM, and the scores computed by walking it.
/// Locations are slots: 0, 1, 2, ... in the order of adding.
class LikelihoodModel {
 public:
  /// Empty. `kind`: which of the two scores.
  explicit LikelihoodModel(LikelihoodKind kind) : kind_(kind) {}

  /// Adds the signature of the next slot (empty for a bad signature).
  void Add(const Signature& signature);
  /// Takes a slot's words out of the index (merged by rehearsal, or transferred out of working memory).
  void Remove(int slot);
  /// Puts a slot's words in again (retrieved from long-term memory).
  void Restore(int slot, const Signature& signature);
  /// Signature of a slot; empty for a bad one and for one that is not in the index.
  const Signature& signature(int slot) const { return signatures_[internal::Index(slot)]; }

  /// Raw scores s_i of every slot (0 where nothing is shared). Section 2, both variants:
  /// similarity: s_i = (sum over shared words of min(multiplicity)) / max(|z_t|, |z_i|);
  /// tf-idf: s_i = sum over unique words w of z_t of (n_wi / n_i) * log10(N / n_w), with N locations in STM
  /// and WM, n_w of them with w, n_wi occurrences of w in i, n_i words in i.
  std::vector<double> Scores(const Signature& query) const;

  /// Counts of matched words of every slot, by inverse frequency, in which each part of the image has a
  /// limited say:
  ///   c_i = sum over strips h of [sum over cells g in h of ln(1 + x_gi)]^(3/4),
  ///   x_gi = sum over words w seen in g of (n_wi / m_w) log10(N / n_w) / log10 N,
  /// with m_w features of word w in the image, N, n_w and n_wi as above. Words near one another show the same
  /// thing, and a thing that is there twice (a poster, a kind of window) is not yet the place: a place agrees
  /// all over the image (docs/loop-closure.md section 2).
  /// Without words that have been in sight ever since a place (`sight`): they are no sign of a return to it.
  std::vector<double> Counts(const SeenWords& query, const Sight& sight = {}) const;

  /// True if a slot is in the index, be it with a bad signature.
  bool Has(int slot) const { return present_[internal::Index(slot)]; }
  /// Slots ever added.
  int size() const { return static_cast<int>(signatures_.size()); }
  /// Locations in the index, bad signatures included: N.
  int NumLocations() const { return locations_; }

  template <class Archive>
  void State(Archive& archive);

 private:
  void Insert(int slot);

  LikelihoodKind kind_;
  WordMap<std::vector<Posting>> postings_;  // of words that a location has, by slot
  std::vector<Signature> signatures_;       // by slot
  std::vector<bool> present_;               // by slot
  int locations_ = 0;
};

/// Adjustment of the raw scores of the locations in `working_memory` (section 2; Labbe & Michaud 2013, eq. 5
/// and 6), with mu and sigma (sample deviation, n-1) over the non-zero scores:
///   L_i = (s_i - (sigma - 1e-4)) / mu if s_i > mu + sigma, else 1;
///   L_new = mu / sigma + 1 if sigma > 1e-4 and some s_i > mu + sigma, else 2.
Belief AdjustLikelihood(const std::vector<double>& scores, const std::vector<int>& working_memory);

}  // namespace tutti
