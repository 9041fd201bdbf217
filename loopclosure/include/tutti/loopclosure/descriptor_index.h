// Nearest-neighbour search over the words of one vocabulary.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

namespace tutti {

/// The two nearest words of a descriptor, by TRUE distance (Euclidean, not squared; or Hamming in bits).
struct TwoNearest {
  int first = -1;   ///< index of the nearest, -1 if there is none
  int second = -1;  ///< index of the second, -1 if there is none
  float first_distance = std::numeric_limits<float>::infinity();   ///< to the nearest
  float second_distance = std::numeric_limits<float>::infinity();  ///< to the second

  /// Takes one more candidate in; a candidate that is there already changes nothing. Ties: the smaller index.
  void Offer(int index, float distance);
};

/// An index that grows by insertion. Rows are numbered 0, 1, 2, ... in the order of insertion. Deterministic:
/// equal insertions and queries give equal answers.
class DescriptorIndex {
 public:
  virtual ~DescriptorIndex() = default;
  /// Appends descriptors (N x D, type of the index); the rows are kept, not copied.
  virtual void Add(const cv::Mat& rows) = 0;
  /// The (approximately) two nearest rows of one descriptor, a row of a cv::Mat of the index's type and
  /// width.
  virtual TwoNearest Search(const std::uint8_t* descriptor) const = 0;
  /// Number of rows.
  virtual int size() const = 0;
};

/// kd-forest over CV_32F descriptors, on FLANN (Muja & Lowe 2009): `trees` randomised trees, `checks` leaves
/// per search.
///
/// FLANN's own forest draws from std::random_device and the process-wide rand(), so two runs never agree, and
/// its rebuild on doubling stops the caller for a while. Here every tree is a FLANN index of its own that
/// starts from one word and grows by insertion alone, each tree in a seeded order of its own: the trees
/// differ, nothing is random, nothing is rebuilt.
std::unique_ptr<DescriptorIndex> MakeKdForestIndex(int dimensions, int trees, int checks, std::uint64_t seed);

/// Hash tables over CV_8U descriptors, Hamming distance: each table indexes a seeded choice of bits, buckets
/// one bit away are probed as well; small vocabularies are searched exactly.
std::unique_ptr<DescriptorIndex> MakeHammingIndex(int bytes, int tables, std::uint64_t seed);

}  // namespace tutti
