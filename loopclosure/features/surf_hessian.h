// Determinants of the Hessian of an image at all places and scales: what SURF finds its points in. Internal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "core/index.h"
#include "loopclosure/features/surf_integral.h"

namespace tutti::internal {

/// Equal to those of dlib::hessian_pyramid, sum for sum; but a layer of which the octave before holds every
/// value is taken from there, and a row of determinants is computed as a whole, each of its sums of integers
/// in the order that suits vectors.
///
/// H. Bay, A. Ess, T. Tuytelaars, L. Van Gool, "Speeded-Up Robust Features (SURF)", CVIU 110(3), 2008.
class SurfHessian {
 public:
  static constexpr int kIntervals = 4;  ///< layers of an octave

  /// Takes another image, in the memory of the one before.
  void Compute(const SurfIntegral& image, int octaves);

  int octaves() const { return octaves_; }

  /// Pixels of the image from one place of an octave to the next.
  static int Step(int octave) { return kFirstStep << octave; }

  /// Places at each side of a layer that have no value, because their boxes would reach out of the image.
  static int Border(int interval) { return (3 * (2 * (interval + 1) + 1) + 1) / 2; }

  /// Determinants of an octave's layer, rows x columns, CV_64F; negative where the trace is.
  const cv::Mat& Layer(int octave, int interval) const {
    return layers_[Index(octave) * kIntervals + Index(interval)];
  }

 private:
  static constexpr int kFirstStep = 2;

  cv::Mat& At(int octave, int interval) { return layers_[Index(octave) * kIntervals + Index(interval)]; }
  void Fill(const SurfIntegral& image, int octave, int interval);
  void CopyFromFiner(int octave, int interval, int finer_interval);

  int octaves_ = 0;
  std::vector<cv::Mat> layers_;
  cv::Mat split_;                 // sums at even columns, then those at odd ones
  std::vector<std::int32_t> xx_;  // of a row
  std::vector<std::int32_t> yy_;
  std::vector<std::int32_t> xy_;
};

/// Marks in `found` the columns from `begin` to `past` at which line `h` of a layer, by absolute values, is
/// at least `least` and nowhere less than its neighbours beside, above, below, and in the finer and the
/// coarser layer: what may be a maximum.
void FindMaxima(const double* h, const double* u, const double* d, const double* finer, const double* coarser,
                int begin, int past, double least, std::uint8_t* found);

}  // namespace tutti::internal
