// Removes the lens distortion of one camera, and aligns the rows of a stereo pair.
#pragma once

#include <opencv2/core.hpp>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti {

/// How images are sampled. kNearest is for depth: a mean of two depths is a surface that is not there.
enum class Sampling { kLinear, kNearest };

/// Warps images of a distorted camera to a pinhole camera, by tables that are computed once. Immutable after
/// construction, so it may be used from several threads.
class Rectifier {
 public:
  /// One camera. The new pinhole camera has the same size and fx : fy; its field of view is the largest
  /// rectangle in which every pixel has a source (no black borders), 60 deg to each side at most. No
  /// distortion: images pass as they are.
  explicit Rectifier(const PinholeCamera& distorted);

  /// The camera `distorted`, turned by R_rectified_camera (rays: r_rectified = R * r_camera), seen through
  /// `target`, which must be free of distortion.
  Rectifier(const PinholeCamera& distorted, const PinholeCamera& target,
            const Eigen::Matrix3d& R_rectified_camera);

  /// The camera after rectification.
  const PinholeCamera& Camera() const { return target_; }
  /// `image` must have the size of the distorted camera; any type. Pixels without a source become 0.
  cv::Mat Apply(const cv::Mat& image, Sampling sampling = Sampling::kLinear) const;

 private:
  void BuildTables(const PinholeCamera& distorted, const Eigen::Matrix3d& R_camera_rectified);

  PinholeCamera target_;
  bool identity_ = false;
  cv::Mat linear_xy_, linear_fraction_;  // fixed-point tables of cv::convertMaps
  cv::Mat nearest_xy_;
};

/// Rolling shutter: how long after the first row the last one of a rectified image was read [s], near the
/// optical axis. `readout_s`: of the image as it was taken.
inline double RectifiedReadout(double readout_s, const PinholeCamera& distorted,
                               const PinholeCamera& rectified) {
  return readout_s * (distorted.fy / rectified.fy) * (rectified.height - 1) / (distorted.height - 1);
}

/// The two rectifiers of a stereo pair. After them a point has the same row in both images, and the right
/// camera lies at +x of the left one.
struct StereoRectification {
  Rectifier left;
  Rectifier right;
  double baseline_m;      ///< distance of the two cameras [m]
  Pose T_left_rectified;  ///< rectified left camera -> left camera as calibrated (a rotation)
};

/// Rectifies two cameras of equal size with any distortion (Bouguet's method, as cv::stereoRectify: half the
/// rotation to each side, then the baseline onto the x axis). Both get the same intrinsics, without black
/// borders. Throws InputError if the right camera does not lie to the right of the left one, or the sizes
/// differ.
StereoRectification RectifyStereo(const PinholeCamera& left, const PinholeCamera& right,
                                  const Pose& T_right_left);

}  // namespace tutti
