// Pinhole camera with radial-tangential or equidistant (fisheye) distortion.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>

#include "tutti/core/options.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Lens distortion. radtan: k1 k2 p1 p2 k3 as in OpenCV; equidistant: k1..k4 (Kannala-Brandt, cv::fisheye).
enum class Distortion { kNone, kRadTan, kEquidistant };

/// The words of the YAML files.
EnumWords<Distortion> WordsOf(Distortion);
/// radtan: k1 k2 p1 p2 k3; equidistant: k1 k2 k3 k4, and 0.
using DistortionCoefficients = std::array<double, 5>;

/// Pinhole camera: section `camera:` of the YAML files. Pixel (0, 0) is the centre of the top-left pixel; x
/// right, y down. Zeros are no camera.
struct PinholeCamera {
  TUTTI_OPTION(int, width, 0, "image width", Basic(), Unit("px"), From(1));
  TUTTI_OPTION(int, height, 0, "image height", Basic(), Unit("px"), From(1));
  TUTTI_OPTION(double, fx, 0, "focal length", Basic(), Unit("px"), Above(0));
  TUTTI_OPTION(double, fy, 0, "focal length", Basic(), Unit("px"), Above(0));
  TUTTI_OPTION(double, cx, 0, "principal point; the centre of the top-left pixel is (0, 0)", Basic(),
               Unit("px"));
  TUTTI_OPTION(double, cy, 0, "principal point", Basic(), Unit("px"));
  TUTTI_OPTION(Distortion, distortion, Distortion::kNone, "lens model", Basic());
  TUTTI_OPTION(DistortionCoefficients, coefficients, {}, "radtan: k1 k2 p1 p2 k3; equidistant: k1 k2 k3 k4",
               Basic());
  TUTTI_OPTIONS_END;

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
#pragma GCC visibility pop
