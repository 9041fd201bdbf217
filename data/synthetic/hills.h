// What the town's streets go up and down over.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "data/synthetic/rasterizer.h"

namespace tutti::synthetic {

/// Immutable. Frame of reference: as Scene.
class Hills {
 public:
  /// `height_m`: of the highest place above the middle one [m]; 0: flat.
  explicit Hills(double height_m) : height_(height_m) {}

  /// Height of the ground at a place [m].
  double HeightAt(const Eigen::Vector2d& at) const {
    return 0.5 * height_ *
           (std::sin(2 * M_PI * at.x() / kLengthX + kPhaseX) + std::sin(2 * M_PI * at.y() / kLengthY));
  }
  /// Slope of the ground at a place, in a direction [rad], that a car feels over its 2.8 m: positive uphill.
  double SlopeAt(const Eigen::Vector2d& at, double heading) const {
    const Eigen::Vector2d half = kHalfWheelbase * Eigen::Vector2d(std::cos(heading), std::sin(heading));
    return std::atan2(HeightAt(at + half) - HeightAt(at - half), 2 * kHalfWheelbase);
  }
  /// The point of a car that stands there that is so high above the ground, at right angles to it.
  Eigen::Vector3d PointAt(const Eigen::Vector2d& at, double above_m) const {
    const Eigen::Vector3d upwards(-std::tan(SlopeAt(at, 0)), -std::tan(SlopeAt(at, M_PI / 2)), 1);
    return Eigen::Vector3d(at.x(), at.y(), HeightAt(at)) + above_m * upwards.normalized();
  }
  /// Moves faces that stand on flat ground. Each stays a parallelogram; what lies on the ground is cut into
  /// pieces that follow it, of which all but the first come after all other faces.
  void Lift(std::vector<Face>* faces) const {
    if (height_ == 0) return;
    for (std::size_t k = 0, n = faces->size(); k < n; ++k) {
      const Face face = (*faces)[k];
      if (face.emits) continue;
      if (face.edge_u.norm() > kWholeGround) {  // under all streets
        (*faces)[k].corner.z() -= 2 * height_;
        continue;
      }
      const bool lies = face.corner.z() == 0 && face.edge_u.z() == 0 && face.edge_v.z() == 0;
      const int along_u = lies ? PiecesOf(face.edge_u) : 1, along_v = lies ? PiecesOf(face.edge_v) : 1;
      (*faces)[k] = LiftedPiece(face, 0, along_u, 0, along_v);
      for (int i = 1; i < along_u * along_v; ++i)
        faces->push_back(LiftedPiece(face, i % along_u, along_u, i / along_u, along_v));
    }
  }

 private:
  static int PiecesOf(const Eigen::Vector3d& edge) {
    return std::max(1, static_cast<int>(std::ceil(edge.norm() / kPiece)));
  }
  // The i-th of n pieces along edge_u, and the j-th of m along edge_v.
  Face LiftedPiece(const Face& whole, int i, int n, int j, int m) const {
    Face face = whole;
    face.corner += i * whole.edge_u / n + j * whole.edge_v / m;
    face.edge_u /= n;
    face.edge_v /= m;
    face.repeat_u /= n;
    face.repeat_v /= m;
    face.offset_u += i * face.repeat_u;
    face.offset_v += j * face.repeat_v;
    const double corner = HeightAt(face.corner.head<2>());
    const Eigen::Vector3d u = face.corner + face.edge_u, v = face.corner + face.edge_v;
    face.corner.z() += corner;
    face.edge_u.z() += HeightAt(u.head<2>()) - corner;
    face.edge_v.z() += HeightAt(v.head<2>()) - corner;
    return face;
  }

  static constexpr double kLengthX = 150, kLengthY = 115;  // from one to the next [m]
  static constexpr double kPhaseX = 0.5, kHalfWheelbase = 1.4, kWholeGround = 500, kPiece = 2;

  double height_;
};

}  // namespace tutti::synthetic
