// Pinhole camera with radial-tangential or equidistant (fisheye) distortion.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>

namespace tutti {

/// Lens distortion. radtan: k1 k2 p1 p2 k3 as in OpenCV; equidistant: k1..k4 (Kannala-Brandt, cv::fisheye).
enum class Distortion { kNone, kRadTan, kEquidistant };

/// Pinhole camera. Pixel (0, 0) is the centre of the top-left pixel; x right, y down.
struct PinholeCamera {
  int width = 0;    ///< [px]
  int height = 0;   ///< [px]
  double fx = 0.0;  ///< focal length [px]
  double fy = 0.0;  ///< focal length [px]
  double cx = 0.0;  ///< principal point [px]
  double cy = 0.0;  ///< principal point [px]
  Distortion distortion = Distortion::kNone;
  std::array<double, 5> coefficients{};  ///< radtan: k1 k2 p1 p2 k3; equidistant: k1 k2 k3 k4 -

  /// Pixel of a point in the camera frame [m]; the point must have z > 0.
  Eigen::Vector2d Project(const Eigen::Vector3d& point) const;
  /// Ray (x/z, y/z, 1) of a pixel, distortion removed (iteratively; to about 1e-9).
  Eigen::Vector3d Unproject(const Eigen::Vector2d& pixel) const;
  /// 3x3 intrinsic matrix K.
  Eigen::Matrix3d Matrix() const;
  /// True if the pixel lies in the image, at least `border` pixels from its edge.
  bool Contains(const Eigen::Vector2d& pixel, double border = 0.0) const;
  /// Empty if usable, else what is wrong with it and what to do.
  std::string Validate() const;
};

}  // namespace tutti
