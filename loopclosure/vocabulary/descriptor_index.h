// Nearest-neighbour search over the words of one vocabulary.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

namespace tutti {

namespace internal {
class PackedMat;
class StateReader;
class StateWriter;
}  // namespace internal

/// The two nearest words of a descriptor, by TRUE distance (Euclidean, not squared; or Hamming in bits).
struct TwoNearest {
  int first = -1;   ///< word id of the nearest, -1 if there is none
  int second = -1;  ///< word id of the second, -1 if there is none
  float first_distance = std::numeric_limits<float>::infinity();   ///< to the nearest
  float second_distance = std::numeric_limits<float>::infinity();  ///< to the second, at least first_distance

  /// Takes one more candidate in; a candidate that is there already changes nothing. Ties: the smaller id.
  void Offer(int word, float distance);
};

/// An index of words that come, go and come back. Deterministic: equal histories give equal answers.
class DescriptorIndex {
 public:
  virtual ~DescriptorIndex() = default;
  /// Adds words (one id and one row each; rows of the index's type and width, which are copied). A word that
  /// was removed may come back, under its id and with its descriptor.
  virtual void Add(const std::vector<int>& words, const cv::Mat& rows) = 0;
  /// Takes a word out: no search finds it from now on. Words that are not there are left alone.
  virtual void Remove(int word) = 0;
  /// The (approximately) two nearest words of each descriptor: rows of the index's type and width. What is
  /// found for one does not depend on the others. Safe to call from several threads at once.
  virtual std::vector<TwoNearest> Search(const cv::Mat& descriptors) const = 0;
  /// A word's descriptor; nullptr if it is not in the index.
  virtual const std::uint8_t* Find(int word) const = 0;
  virtual int size() const = 0;
  /// A loaded index goes on as the saved one would; it must be of the same kind, width and seed. `known`:
  /// descriptors that whoever loads it has, too (WordStorage::State).
  virtual void State(internal::StateWriter& archive, const std::vector<internal::PackedMat>& known) = 0;
  virtual void State(internal::StateReader& archive, const std::vector<internal::PackedMat>& known) = 0;
};

/// kd-forest over CV_32F descriptors (Muja & Lowe 2009): `trees` randomised trees, `checks` leaves per
/// search.
///
/// Trees and search follow FLANN's rules. Every tree starts from one word and changes by insertion and
/// removal alone, each in a seeded order of its own: the trees differ, nothing is random, and no image pays
/// for the others.
std::unique_ptr<DescriptorIndex> MakeKdForestIndex(int dimensions, int trees, int checks, std::uint64_t seed);

/// Such a forest of FLANN's own KDTreeIndex: for comparison (docs/loop-closure.md, section 3). FLANN keeps
/// every branch that a search passes, clears a bitset and reserves a heap of the size of the index for each
/// tree and query, and can't let go of a removed word, so that all trees are grown anew once most of their
/// words are gone.
std::unique_ptr<DescriptorIndex> MakeFlannIndex(int dimensions, int trees, int checks, std::uint64_t seed);

/// Random tries over CV_8U descriptors, Hamming distance: each of `tables` tries takes the bits in a seeded
/// order of its own; a search looks into the leaf that the descriptor falls into and into those that one
/// other bit leads to. Small vocabularies are searched exactly.
std::unique_ptr<DescriptorIndex> MakeHammingIndex(int bytes, int tables, std::uint64_t seed);

}  // namespace tutti
