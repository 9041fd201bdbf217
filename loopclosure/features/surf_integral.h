// The integral image that dlib's SURF reads its sums from. Internal.
#pragma once

#include <dlib/geometry.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

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

}  // namespace tutti::internal
