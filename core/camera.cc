#include "tutti/core/camera.h"

#include <Eigen/LU>

#include <cmath>

namespace tutti {
namespace {

// Distorts normalised coordinates (x/z, y/z).
Eigen::Vector2d Distort(const PinholeCamera& camera, const Eigen::Vector2d& p) {
  const auto& c = camera.coefficients;
  if (camera.distortion == Distortion::kRadTan) {
    const double x = p.x(), y = p.y(), r2 = p.squaredNorm();
    const double radial = 1.0 + r2 * (c[0] + r2 * (c[1] + r2 * c[4]));
    return {x * radial + 2.0 * c[2] * x * y + c[3] * (r2 + 2.0 * x * x),
            y * radial + c[2] * (r2 + 2.0 * y * y) + 2.0 * c[3] * x * y};
  }
  if (camera.distortion == Distortion::kEquidistant) {
    const double r = p.norm();
    if (r < 1e-12) return p;
    const double theta = std::atan(r), t2 = theta * theta;
    const double distorted = theta * (1.0 + t2 * (c[0] + t2 * (c[1] + t2 * (c[2] + t2 * c[3]))));
    return p * (distorted / r);
  }
  return p;
}

}  // namespace

Eigen::Vector2d PinholeCamera::Project(const Eigen::Vector3d& point) const {
  const Eigen::Vector2d d = Distort(*this, point.head<2>() / point.z());
  return {fx * d.x() + cx, fy * d.y() + cy};
}

Eigen::Vector3d PinholeCamera::Unproject(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d target((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
  if (distortion == Distortion::kNone) return {target.x(), target.y(), 1.0};
  // Newton's method with a numeric Jacobian; the fixed point iteration fails for strong distortion.
  Eigen::Vector2d p = target;
  if (distortion == Distortion::kEquidistant) {
    const double theta = target.norm();
    if (theta > 1e-9 && theta < 1.5) p = target * (std::tan(theta) / theta);
  }
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d error = Distort(*this, p) - target;
    if (error.squaredNorm() < 1e-22) break;
    constexpr double h = 1e-6;
    Eigen::Matrix2d jacobian;
    jacobian.col(0) =
        (Distort(*this, p + Eigen::Vector2d(h, 0)) - Distort(*this, p - Eigen::Vector2d(h, 0))) / (2 * h);
    jacobian.col(1) =
        (Distort(*this, p + Eigen::Vector2d(0, h)) - Distort(*this, p - Eigen::Vector2d(0, h))) / (2 * h);
    if (std::abs(jacobian.determinant()) < 1e-12) break;
    p -= jacobian.inverse() * error;
  }
  return {p.x(), p.y(), 1.0};
}

Eigen::Matrix3d PinholeCamera::Matrix() const {
  Eigen::Matrix3d k;
  k << fx, 0, cx, 0, fy, cy, 0, 0, 1;
  return k;
}

bool PinholeCamera::Contains(const Eigen::Vector2d& pixel, double border) const {
  return pixel.x() >= border && pixel.y() >= border && pixel.x() <= width - 1 - border &&
         pixel.y() <= height - 1 - border;
}

std::string PinholeCamera::Validate() const {
  std::string problem = OutOfRange(*this, "camera.");
  // Beyond it a pixel sees half of all directions, or none; the arithmetic ends in infinities before.
  constexpr double kWidest = 0.01, kNarrowest = 1000;  // focal length / image size
  const auto plausible = [](double focal, int size) {
    return focal >= kWidest * size && focal <= kNarrowest * size;
  };
  if (problem.empty() && !(plausible(fx, width) && plausible(fy, height)))
    problem =
        "camera: the focal lengths (fx, fy) are no pixels of this image; 0.01 to 1000 times its size are "
        "possible";
  if (problem.empty() && (cx < 0 || cx > width || cy < 0 || cy > height)) {
    problem =
        "camera: the principal point (cx, cy) lies outside the image; is the calibration of another image "
        "size?";
  }
  return problem;
}

EnumWords<Distortion> WordsOf(Distortion /*of*/) {
  return {{"none", Distortion::kNone},
          {"radtan", Distortion::kRadTan},
          {"equidistant", Distortion::kEquidistant}};
}

}  // namespace tutti
