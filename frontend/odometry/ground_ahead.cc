#include "frontend/odometry/ground_ahead.h"

#include <algorithm>
#include <cmath>

#include "frontend/geometry/ground_plane.h"

namespace tutti {
namespace {

// Ahead of where it is seen [heights]. What is looked at lies between 3 and 8 (GroundPlane), but near ground
// has more pixels, and the nearer, the less an error of the way's direction does.
constexpr double kAbove = 2.8;
constexpr std::size_t kMost = 12;

}  // namespace

void GroundAhead::Add(const Eigen::Vector3d& plane, const Pose& T_camera_first, double way) {
  pieces_.push_back({plane, T_camera_first, way});
  if (pieces_.size() > kMost) pieces_.erase(pieces_.begin());
}

std::vector<GroundAhead::Height> GroundAhead::Approach(const Pose& step) {
  std::vector<Height> reached;
  const auto passed = [&](Piece& piece) {
    piece.T_camera_first = step * piece.T_camera_first;
    const Eigen::Vector3d normal = piece.plane.normalized();
    const Eigen::Vector3d ahead = AheadOnGround(normal);
    const Eigen::Vector3d here = piece.plane.norm() * piece.T_camera_first.Inverse().translation;
    if (!(ahead.dot(here) >= kAbove)) return false;
    const double height = 1 - normal.dot(here);
    const double aside = std::abs(normal.cross(ahead).dot(here));  // beyond what was looked at: unknown
    if (aside < kGroundAside && height > 0)
      reached.push_back({std::log(height / piece.plane.norm()), piece.way});
    return true;
  };
  pieces_.erase(std::remove_if(pieces_.begin(), pieces_.end(), passed), pieces_.end());
  return reached;
}

void GroundAhead::Scale(double scale) {
  for (Piece& piece : pieces_) {
    piece.plane /= scale;
    piece.T_camera_first.translation *= scale;
  }
}

bool GroundAhead::IsPossible() const {
  return pieces_.size() <= kMost && std::all_of(pieces_.begin(), pieces_.end(), [](const Piece& piece) {
           return piece.plane.allFinite() && !piece.plane.isZero() && piece.T_camera_first.IsFinite() &&
                  std::isfinite(piece.way) && piece.way > 0;
         });
}

}  // namespace tutti
