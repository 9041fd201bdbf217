// Members that describe an image as a whole: one vector each, compared along the way (loop-closure.md
// section 3).
#pragma once

#include <cmath>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/numbers.h"

namespace tutti {

/// Empty if a dense member may have this descriptor of an image (or none), else what is wrong. `width`: of
/// those before [values], 0: any.
std::string DescriptorProblem(const cv::Mat& descriptor, int width);

/// Descriptors of all locations in STM and WM, one each, and what an image's descriptor says of them.
/// Locations are slots: 0, 1, 2, ... in the order of adding; the newest is the present image.
///
/// One descriptor of the whole image says little when light or season change; ten in a row say much (SeqSLAM:
/// Milford & Wyeth, ICRA 2012). With the cosine d_t . d_i of two descriptors, the score of a place i is
///   s_i = (1/10) sum over j = 0..9 of (d_{t-j} . d_{i-j} - mu_{t-j}),
/// with t-j and i-j the locations before along the path, mu the mean over the places in WM, and 0 for a pair
/// of which one is missing (before the beginning, in LTM, or without a descriptor). The path is followed in
/// the same direction only. The state depends on nothing but which locations are there: a saved and loaded
/// model gives the same scores.
class DenseModel {
 public:
  /// Images in a row that are compared.
  static constexpr int kSequence = 10;
  /// What a descriptor counts as many words as, where an image's words are counted.
  static constexpr double kWords = 100;
  /// Share of the counts for the images just before that is taken for what a return would show: they have all
  /// but one to three pairs of the sequence in common, and were taken from nearly the same spot.
  static constexpr double kRepeatShare = 0.5;

  /// `width`: of the descriptors [values], where it is known before the first one; 0: the first one says it.
  explicit DenseModel(int width = 0) : width_(width) {}

  /// Adds the descriptor of the next slot (of length 1, 1 x D, CV_32F; empty: none). Throws InputError for
  /// another width than before.
  void Add(const cv::Mat& descriptor);
  /// The newest slot was merged into an older one: it counts for the present image, and is gone after it.
  void Drop(int slot);
  /// Takes a slot's descriptor out (transferred out of working memory).
  void Remove(int slot);
  /// Puts a slot's descriptor in again (retrieved from long-term memory).
  void Restore(int slot, const cv::Mat& descriptor);
  /// The next slot, which is not in memory: merged away, or in long-term memory.
  void AddAbsent(bool merged);
  /// Finishes a series of AddAbsent and Restore.
  void FinishLoading();

  /// Descriptor of a slot; empty if it has none, or is not in memory.
  const cv::Mat& descriptor(int slot) const { return descriptors_[internal::Index(slot)]; }
  /// True if a slot is in memory, be it without a descriptor.
  bool Has(int slot) const { return presence_[internal::Index(slot)] == Presence::kPresent; }
  /// Slots ever added.
  int size() const { return static_cast<int>(descriptors_.size()); }
  /// Empty if a descriptor may be added, else what is wrong.
  std::string Problem(const cv::Mat& descriptor) const { return DescriptorProblem(descriptor, width_); }

  /// Counts of every slot for the present image, to be added to those of words: with the median m and the
  /// median deviation of the scores of `places`,
  ///   z_i = max(0, (s_i - m) / (1.4826 MAD) - 2),   c_i = 20 z_i / (z_i + 4).
  /// 0 with fewer than 12 places, where nothing can stand out.
  std::vector<double> Counts(const std::vector<int>& places) const;
  /// Counts for an image that is no location, by its descriptor alone: s_i = d . d_i.
  std::vector<double> CountsOf(const cv::Mat& descriptor, const std::vector<int>& places) const;
  /// For standardised evidence: means of the cosines, 0 where below 0, of every slot for the present image;
  std::vector<double> Scores() const;
  /// and for an image that is no location.
  std::vector<double> ScoresOf(const cv::Mat& descriptor) const;

  template <class Archive>
  void State(Archive& archive);

 private:
  enum class Presence : char { kAbsent, kPresent, kMerged };
  // Cosines of one of the last images with the descriptors of all slots; 0 where there is none.
  struct Row {
    int slot = -1;
    std::vector<float> cosines;  // empty if the image has none itself
  };
  Row MakeRow(int slot) const;
  std::vector<float> Cosines(const cv::Mat& descriptor) const;
  void MakeRecent();
  std::vector<int> Path() const;
  double MeanOver(const std::vector<int>& places, const Row& row) const;
  template <typename LevelOf, typename Call>
  void ForEachPair(LevelOf level_of, Call call) const;
  static std::vector<double> Contrast(std::vector<double> scores, const std::vector<int>& places);

  std::vector<cv::Mat> descriptors_;  // by slot
  std::vector<Presence> presence_;    // by slot
  std::vector<Row> recent_;           // the last slots of the path, newest last
  int width_;                         // of a descriptor; 0: not known yet
};

/// One descriptor: empty or 1 x D, CV_32F, of length 1.
template <class Archive>
void StateOfDescriptor(Archive& archive, cv::Mat& descriptor) {
  std::vector<float> values;
  if (!Archive::kReading && !descriptor.empty())
    values.assign(descriptor.ptr<float>(), descriptor.ptr<float>() + descriptor.cols);
  archive(values);
  if constexpr (Archive::kReading) {
    descriptor = values.empty() ? cv::Mat() : cv::Mat(values, true).reshape(1, 1);
    if (!descriptor.empty() &&
        (!cv::checkRange(descriptor) || !(std::abs(cv::norm(descriptor) - 1.0) < 1e-3)))
      archive.Damaged("a descriptor that is not of length 1");
  }
}

}  // namespace tutti
