// What the town's streets go up and down over.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "data/synthetic/rasterizer.h"

namespace tutti::synthetic {

/// Immutable. Frame of reference: as Scene.
class Hills {
 public:
  /// `height_m`: of the highest place above the middle one [m]; 0: flat.
  explicit Hills(double height_m) : height_(height_m) {}

  /// Of the ground at a place [m].
  double HeightAt(const Eigen::Vector2d& at) const {
    return 0.5 * height_ *
           (std::sin(2 * M_PI * at.x() / kLengthX + kPhaseX) + std::sin(2 * M_PI * at.y() / kLengthY));
  }
  /// Of the ground at a place, in a direction [rad]: positive uphill. As a car feels it, over 2.8 m.
  double SlopeAt(const Eigen::Vector2d& at, double heading) const {
    const Eigen::Vector2d half = kHalfWheelbase * Eigen::Vector2d(std::cos(heading), std::sin(heading));
    return std::atan2(HeightAt(at + half) - HeightAt(at - half), 2 * kHalfWheelbase);
  }
  /// Moves faces that stand on flat ground; each stays a parallelogram.
  void Lift(std::vector<Face>* faces) const {
    if (height_ == 0) return;
    for (Face& face : *faces) {
      if (face.emits) continue;
      if (face.edge_u.norm() > kWholeGround) {  // under all streets
        face.corner.z() -= 2 * height_;
        continue;
      }
      const double corner = HeightAt(face.corner.head<2>());
      const Eigen::Vector3d u = face.corner + face.edge_u, v = face.corner + face.edge_v;
      face.corner.z() += corner;
      face.edge_u.z() += HeightAt(u.head<2>()) - corner;
      face.edge_v.z() += HeightAt(v.head<2>()) - corner;
    }
  }

 private:
  static constexpr double kLengthX = 150, kLengthY = 115;  // from one to the next [m]
  static constexpr double kPhaseX = 0.5, kHalfWheelbase = 1.4, kWholeGround = 500;

  double height_;
};

}  // namespace tutti::synthetic
