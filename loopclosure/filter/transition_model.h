// p(S_t | S_{t-1}): where the camera may have gone since the last image.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "loopclosure/memory/belief.h"
#include "loopclosure/memory/location_memory.h"

namespace tutti {

/// Sparse, banded transition matrix (loop-closure.md section 2, "Prediction"; Labbe & Michaud 2013, section
/// III-E). Column j = p(. | S_{t-1} = j):
///   from the virtual place: p(-1 | -1) = 0.9, p(i | -1) = 0.1 / (m - 1);
///   from a real place j: a Gaussian (sigma 1.6, 16 levels) over the graph neighbours in working memory,
///   times kLoopShare for each loop link on the way, a deficit below 0.9 given to j itself, the real places
///   scaled to 0.9; p(-1 | j) = 0.1.
/// Columns are cached; a change in the graph recomputes only those within 16 levels. A prediction costs
/// O(|WM|), whatever the camera's path: LocationMemory bounds the neighbours of a place that is seen over and
/// over.
class TransitionModel {
 public:
  static constexpr int kLevels = 16;  ///< graph levels that a camera may go in one step
  /// p(real place at this graph level), before scaling: self, level 1, ..., level 16.
  static const std::array<double, kLevels + 1>& LevelValues();
  static constexpr double kToNewPlace = 0.1;  ///< p(-1 | j)
  static constexpr double kStaysNew = 0.9;    ///< p(-1 | -1), as in Labbe & Michaud 2013
  /// Factor of a place behind a loop link, times the value of its level: the link may be false, and a true
  /// one has the images' own evidence at both ends.
  static constexpr double kLoopShare = 0.2;

  /// Takes in what has changed in the memory since the last call.
  void Update(const LocationMemory& memory, const std::vector<int>& changed_slots);

  /// One prediction: matrix times `posterior`. Both are over the slots of `working_memory`.
  Belief Predict(const Belief& posterior, const std::vector<int>& working_memory) const;

  /// The way back: of each place j, sum over i of p(i | j) value(i), virtual place included; what the images
  /// after one say of where it was.
  Belief Backward(const Belief& value, const std::vector<int>& working_memory) const;

  /// p(. | j): pairs of slot and probability, ascending slots; without the virtual place's kToNewPlace.
  std::vector<std::pair<int, double>> Column(int slot) const;

 private:
  // A column's values by ascending slots, which mostly follow one another: the stretches in which they do.
  struct Run {
    int first;
    int count;
  };
  struct Runs {
    std::vector<Run> runs;
    std::vector<double> values;
    int inner_first = -1;  // of a column with the values of inner_, which then has nothing else
    bool Empty() const { return inner_first < 0 && runs.empty(); }
  };
  static Runs ComputeColumn(const LocationMemory& memory, int slot);
  void ShareInner(Runs& column);
  template <typename Call>
  void ForEachRun(const Runs& column, const Call& call) const;

  std::vector<Runs> columns_;  // by slot; empty: not in WM
  std::vector<double> inner_;  // values in the middle of a path: nearly all columns are the same, and stay in
                               // the processor's cache
};

}  // namespace tutti
