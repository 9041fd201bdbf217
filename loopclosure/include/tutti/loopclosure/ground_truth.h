// Which images show the same place: loop matrices from files, or derived from a trajectory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tutti/core/trajectory.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Label of a pair of images.
enum class LoopLabel : std::uint8_t { kNone = 0, kIgnore = 128, kLoop = 255 };

/// The earlier view that shares most with an image, where the ground truth is by overlap.
struct BestView {
  int column = -1;       ///< which image; -1: there is none with a loop
  double overlap = 0;    ///< share of one that the other sees, of both directions the larger, 0..1
  double angle_deg = 0;  ///< between their cameras' orientations [deg], 0..180
};

/// Loop matrix (loop-closure.md section 7): row = current image, column = past image. Only column < row
/// counts.
class LoopGroundTruth {
 public:
  LoopGroundTruth() = default;
  /// For `size` images, without a loop.
  explicit LoopGroundTruth(int size);

  /// Number of images.
  int size() const { return size_; }
  /// kNone for pairs outside of the matrix and for column >= row.
  LoopLabel At(int row, int column) const;
  /// Does nothing for a pair that At would not answer for.
  void Set(int row, int column, LoopLabel label);
  /// True if the row has at least one loop.
  bool HasLoop(int row) const;
  /// Number of images with at least one loop: what recall is a share of.
  int RowsWithLoop() const;
  /// Every `stride`-th row and column, from 0; without best_views, which may be of columns that are gone.
  LoopGroundTruth Strided(int stride) const;
  /// The first `size` rows and columns.
  LoopGroundTruth First(int size) const;
  /// For a matrix of single images (left, right, left, right...), that of the pairs: images 2i and 2i + 1
  /// make image i. A pair shows the place of another one if one of its images shows that of one of the
  /// other's (left and right change sides when a way is gone back); else it is ignored if one of the four
  /// labels says so.
  LoopGroundTruth PairsJoined() const;

  std::string description;           ///< where it comes from and by which rule, for tables
  std::vector<BestView> best_views;  ///< by overlap: one for each row; else empty
  double least_overlap = 0;          ///< by overlap: that of a loop, 0..1

 private:
  int size_ = 0;
  std::vector<LoopLabel> labels_;
};

/// When two poses are the same place.
struct LoopRule {
  double distance_m = 6.0;  ///< loop: nearer than this [m], and
  double angle_deg = 30.0;  ///< turned by less than this [deg], and
  double exclude_s = 10.0;  ///< at least this much older [s]; younger pairs are ignored
  double ignore_m = 15.0;   ///< nearer than this but no loop: ignored [m]

  /// Empty if usable, else what is wrong and what to do.
  std::string Validate() const;
};

/// Labels from the numbers of a square matrix, row by row: 0 is none, 1 or from 250 on a loop, all others are
/// ignored. A matrix whose lower triangle is empty is transposed. Throws InputError if there are not
/// size x size of them.
LoopGroundTruth LoopsFromMatrix(const std::vector<double>& values, int size);

/// Reads a matrix: PNG, BMP or any image (white = loop, black = none, grey = ignore); text with one row a
/// line (labels as in LoopsFromMatrix), or with two numbers a line: 0-based "row column" pairs of loops among
/// `num_images` images. Throws InputError that names the file (and line) for a missing, damaged or non-square
/// one. MATLAB's files are to be saved as text first (data/README.md).
LoopGroundTruth ReadLoopMatrix(const std::filesystem::path& file, int num_images);

/// Derives the matrix from poses, one per image in the same order.
LoopGroundTruth LoopsFromTrajectory(const Trajectory& trajectory, const LoopRule& rule);

}  // namespace tutti
#pragma GCC visibility pop
