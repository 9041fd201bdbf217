// What a calibration leaves over of a lens.
#pragma once

#include <Eigen/Core>

#include "tutti/core/camera.h"

namespace tutti {

/// Error of a calibrated and rectified camera, with its information. A pixel p, seen from the principal point
/// as d = p - c, belongs at c + d (1 + k1 r^2 + k2 r^4), r^2 = (d_x / fx)^2 + (d_y / fy)^2. Value (k1, k2)
/// [1].
struct LensError {
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  Eigen::Matrix2d information = Eigen::Matrix2d::Identity() * 1e12;  ///< as it is: no error at all

  template <class Archive>
  void State(Archive& archive) {
    archive(value, information);
  }
  /// d pixel / d value at a pixel, 2x2.
  static Eigen::Matrix2d Jacobian(const PinholeCamera& camera, const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d d = pixel - Eigen::Vector2d(camera.cx, camera.cy);
    const double r2 = d.x() * d.x() / (camera.fx * camera.fx) + d.y() * d.y() / (camera.fy * camera.fy);
    Eigen::Matrix2d j;
    j.col(0) = d * r2;
    j.col(1) = d * (r2 * r2);
    return j;
  }
  /// Where a pixel belongs.
  static Eigen::Vector2d Correct(const PinholeCamera& camera, const Eigen::Vector2d& value,
                                 const Eigen::Vector2d& pixel) {
    return pixel + Jacobian(camera, pixel) * value;
  }
  /// The inverse of Correct.
  static Eigen::Vector2d Uncorrect(const PinholeCamera& camera, const Eigen::Vector2d& value,
                                   const Eigen::Vector2d& corrected) {
    Eigen::Vector2d pixel = corrected;
    if (value.isZero()) return pixel;
    for (int i = 0; i < 5; ++i)
      pixel = corrected - Jacobian(camera, pixel) * value;  // each divides by 20 or more
    return pixel;
  }
};

}  // namespace tutti
