// What the words that an image shares with each place say about where it was taken: evidence in absolute
// terms, against the level that places reach by resemblance alone.
#pragma once

#include <vector>

#include "loopclosure/memory/belief.h"
#include "tutti/loopclosure/detector_options.h"

namespace tutti {

/// Likelihood of the places by their counts of matched words (docs/loop-closure.md section 2).
///
/// The *alias level* Lambda is what the best of the wrong places reaches in this environment. It is learnt
/// without labels: an image that shows a new place (by the filter's own posterior) tells it by its best
/// place, any other by its best place far from the one where it was taken. A place that attracts every image
/// (its mean count is high) has a higher level of its own. With the count C_i of a place,
///
///   log L_i = max(floor, beta ln[(C_i + 1) / (Lambda_i + 1)]),   L_new = 1.
///
/// An image that shares little with anything (dark, blurred, in the rain) shares less with wrong places, too:
/// its levels are lower by what it shares with the few images just before, compared with what images of new
/// places usually do.
///
/// A house that stands twice stays in sight for several images, and each of them says the same again. How
/// often aliases last here, s, is learnt as well: the share of images whose best wrong place follows that of
/// the image before. Evidence is then no more than what is new in the image, with v the share of it that the
/// image before has, too:
///
///   log L_i = max(floor, (1 - v min(1, persistence s)) beta ln[(C_i + 1) / (Lambda_i + 1)]).
///
/// So shared words speak for a place only beyond what resemblance alone brings about, few of them speak
/// against all places, and an image without any says "new place", however many places there are.
class AliasEvidence {
 public:
  /// Images before which nothing is known: the level is a share of the image's words.
  static constexpr int kFirstImages = 5;

  explicit AliasEvidence(const EvidenceOptions& options) : options_(options) {}

  /// The likelihood of an image with these counts (by slot) over the places of `working_memory`. `words`:
  /// that the image has; `repeated`: its mean count for the few images before; `overlap`, 0 to 1: what the
  /// image before has of its own count.
  Belief Likelihood(const std::vector<double>& counts, const std::vector<int>& working_memory, double words,
                    double repeated, double overlap);

  /// The likelihood of an image by itself, which is no location: nothing is learnt.
  Belief Of(const std::vector<double>& counts, const std::vector<int>& working_memory) const;

  /// Learns from the same image, after the filter's step: `near` are the slots of the most probable place and
  /// its neighbours, ascending; `new_place` is the posterior of the new place.
  void Learn(const std::vector<double>& counts, const std::vector<int>& working_memory,
             const std::vector<int>& near, double new_place);

  /// Lambda.
  double Level() const;
  /// Lambda_i of one slot.
  double LevelOf(int slot) const;
  /// s, 0 to 1: how often the best wrong place follows that of the image before.
  double Lasting() const { return lasting_; }

  template <class Archive>
  void State(Archive& archive);
  /// The common level alone, without what is known of single places.
  template <class Archive>
  void StateOfLevel(Archive& archive);

 private:
  // With the levels times `share` and the sharpness times `say`.
  Belief Weighed(const std::vector<double>& counts, const std::vector<int>& working_memory, double share,
                 double say) const;
  void LearnLasting(int alias);

  EvidenceOptions options_;
  double log_level_ = 0;      // ln(Lambda + 1)
  double words_sum_ = 0;      // of the first images
  int first_images_ = 0;      // that were seen, up to kFirstImages
  double images_ = 15;        // that the running mean stands for
  std::vector<double> sum_;   // by slot: counts of images that were taken elsewhere,
  std::vector<double> seen_;  // and how many they were
  double all_sum_ = 0;
  double all_seen_ = 0;
  double log_repeated_ = 0;     // running mean of ln(repeated) over images of new places
  double repeated_images_ = 0;  // that it stands for
  double log_repeated_now_ = 0;
  double lasting_ = 0;   // s
  int last_alias_ = -1;  // slot of the best wrong place of the image before, -1: none
};

/// How much a member counts in the sum of all: by what it shows of the same place against what it shows of
/// wrong ones, w ~ R / (E[f^2] + 1), with f its largest count far from where the image was taken and R its
/// mean count for the few images before. A member that matches everything everywhere has a large f, one that
/// matches nothing has R = 0: neither has a say.
class MemberWeight {
 public:
  /// The member's count for an image just before.
  void Repeat(double count);
  /// Counts (by slot) of the member for an image; `near`, ascending: slots of the most probable place and its
  /// neighbours.
  void Learn(const std::vector<double>& counts, const std::vector<int>& working_memory,
             const std::vector<int>& near);
  /// The weight, above 0, of no scale.
  double Value() const;

  template <class Archive>
  void State(Archive& archive);

 private:
  double repeated_ = 0;  // sum of counts for the images before
  double repeated_images_ = 0;
  double false_square_ = 0;  // sum of squared largest false counts
  double false_images_ = 0;
};

/// Which members say the same: two that see the same things (one member twice, SIFT and RootSIFT) must not
/// have twice the say. By the correlation rho of their counts over places where the image was not taken:
///     copies(k) = sum over the members j of max(0, rho_jk)^8
/// is 1 for a member of its own kind, 2 where another one always says the same. The power leaves those alone
/// that resemble each other because they look at the same image.
class MemberOverlap {
 public:
  /// Takes note of the members' counts (by slot; nullptr for one that sat out) for an image; `near`,
  /// ascending: slots of the most probable place and its neighbours.
  void Learn(const std::vector<const std::vector<double>*>& counts, const std::vector<int>& working_memory,
             const std::vector<int>& near);
  /// How many members say what this one says, itself included: 1 up to their number. 1 before anything is
  /// known.
  double Copies(std::size_t member) const;
  /// That were seen, 0 before anything is known.
  std::size_t members() const { return members_; }

  template <class Archive>
  void State(Archive& archive);

 private:
  double Correlation(std::size_t a, std::size_t b) const;

  std::size_t members_ = 0;
  std::vector<double> covariance_;  // members x members, summed over images
};

}  // namespace tutti
