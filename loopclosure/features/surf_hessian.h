// Determinants of the Hessian of an image at all places and scales: what SURF finds its points in. Internal.
#pragma once

#include <dlib/geometry.h>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "core/numbers.h"

namespace tutti::internal {

/// In place of dlib::integral_image: with a row and a column of zeros before the first, so that no sum has to
/// ask whether it touches the border. The same sums, in a fraction of the time.
class SurfIntegral {
 public:
  /// `grey`: an 8-bit image of at most 2^23 pixels, which takes the place of the one before.
  void Compute(const cv::Mat& grey) { cv::integral(grey, sums_, CV_32S); }

  long nr() const { return sums_.rows - 1; }
  long nc() const { return sums_.cols - 1; }

  /// Sums over all that lies above and left of the pixels of a row.
  const int* Row(long r) const { return sums_.ptr<int>(static_cast<int>(r)); }

  /// Haar wavelets of `width` pixels around a point, as dlib::haar_x and dlib::haar_y define them; both share
  /// their corners.
  std::pair<int, int> Haar(const dlib::point& p, long width) const {
    const long left = p.x() - width / 2;
    const long top = p.y() - width / 2;
    const long right = left + width;
    const int* t = Row(top);
    const int* m = Row(p.y());
    const int* b = Row(top + width);
    const int x = (b[right] - 2 * b[p.x()] + b[left]) - (t[right] - 2 * t[p.x()] + t[left]);
    const int y = (b[right] - b[left]) - 2 * (m[right] - m[left]) + (t[right] - t[left]);
    return {x, y};
  }

 private:
  cv::Mat sums_;
};

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
