#include "frontend/odometry/depth_rotation.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/dense_solvers.h"
#include "core/least_squares.h"
#include "core/numbers.h"

namespace tutti {
namespace {

constexpr int kAlignments = 15;
constexpr int kFewestAligned = 200;  // points that find a surface
constexpr double kSteep = 0.25;      // cosine between ray and normal, below which a surface is too slanted
constexpr double kOneSurface = 0.1;  // neighbours whose inverse depths differ by more are of two [1/m]
constexpr double kInSigmas = 9;      // square of the distance from a surface at which Huber's loss begins

struct Surface {
  Eigen::Vector3d point, normal;
};

// Where a grid's pixels are at the time of the middle row.
class Surfaces {
 public:
  Surfaces(const RollingShutter& shutter, const MovingDepth& depth)
      : camera_(shutter.camera()), grid_(depth.grid) {
    for (int r = 0; r < grid_.Rows(); ++r)
      T_row_middle_.push_back(ExpSE3(depth.motion * shutter.TimeOf(grid_.PixelOf(r, 0).y())));
  }

  std::optional<Surface> Towards(const Eigen::Vector3d& p) const {
    if (!(p.z() > 0.1)) return std::nullopt;
    const int row = static_cast<int>(std::lround(std::clamp(CellOf(p).y(), 0.0, grid_.Rows() - 1.0)));
    const Eigen::Vector3d then = T_row_middle_[internal::Index(row)] * p;
    if (!(then.z() > 0.1)) return std::nullopt;
    const Eigen::Vector2d at = CellOf(then);
    if (!(at.x() > 0.5 && at.y() > 0.5 && at.x() < grid_.columns - 1.5 && at.y() < grid_.Rows() - 1.5))
      return std::nullopt;
    const int c = static_cast<int>(std::lround(at.x())), r = static_cast<int>(std::lround(at.y()));
    const float here = grid_.At(r, c);
    for (const float near :
         {grid_.At(r, c - 1), grid_.At(r, c + 1), grid_.At(r - 1, c), grid_.At(r + 1, c)}) {
      if (!(here > 0 && near > 0 && std::abs(near - here) < kOneSurface)) return std::nullopt;
    }
    Surface surface;
    surface.point = PointAt(r, c);
    surface.normal =
        (PointAt(r, c + 1) - PointAt(r, c - 1)).cross(PointAt(r + 1, c) - PointAt(r - 1, c)).normalized();
    if (!(std::abs(surface.normal.dot(surface.point.normalized())) > kSteep)) return std::nullopt;
    return surface;
  }

  Eigen::Vector3d PointAt(int r, int c) const {
    return T_row_middle_[internal::Index(r)].Inverse() *
           (camera_.Unproject(grid_.PixelOf(r, c)) / std::abs(double(grid_.At(r, c))));
  }

 private:
  Eigen::Vector2d CellOf(const Eigen::Vector3d& p) const {
    return (camera_.Project(p) - grid_.PixelOf(0, 0)) / double(grid_.step);
  }

  const PinholeCamera& camera_;
  const DepthGrid& grid_;
  std::vector<Pose> T_row_middle_;
};

}  // namespace

std::optional<DepthAlignment> AlignDepth(const RollingShutter& shutter, const MovingDepth& first,
                                         const MovingDepth& second, const Pose& T_second_first,
                                         const Matrix6d& prior, double inverse_sigma) {
  const Surfaces from(shutter, first), to(shutter, second);
  std::vector<Eigen::Vector3d> points;
  for (int r = 0; r < first.grid.Rows(); ++r) {
    for (int c = 0; c < first.grid.columns; ++c) {
      if (first.grid.At(r, c) > 0) points.push_back(from.PointAt(r, c));
    }
  }
  Pose T = T_second_first;
  Matrix6d hessian;
  for (int round = 0; round < kAlignments; ++round) {
    hessian = prior;
    Vector6d gradient = prior * LogSE3(T * T_second_first.Inverse());
    int found = 0;
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector3d p = T * point;
      const std::optional<Surface> surface = to.Towards(p);
      if (!surface) continue;
      // Both depths are measured along about the same ray.
      const double sigma = std::sqrt(2.0) * inverse_sigma * p.z() * p.z() * std::abs(surface->normal.z());
      const double r = surface->normal.dot(p - surface->point) / sigma;
      if (!(std::abs(r) < 20)) continue;
      Vector6d j;
      j << surface->normal, p.cross(surface->normal);
      j /= sigma;
      const double weight = internal::HuberWeight(r * r, kInSigmas);
      hessian += weight * j * j.transpose();
      gradient += weight * r * j;
      ++found;
    }
    if (found < kFewestAligned) return std::nullopt;
    hessian += 1e-6 * Matrix6d::Identity();
    const Vector6d step = internal::SolveLdlt(Matrix6d(hessian), Vector6d(-gradient));
    T = Pose(ExpSO3(step.tail<3>()), step.head<3>()) * T;
    if (!T.IsFinite()) return std::nullopt;
  }
  return DepthAlignment{T, hessian};
}

std::optional<DepthRotation> RotationByDepth(const RollingShutter& shutter, const MovingDepth& first,
                                             const MovingDepth& second, const Pose& T_second_first,
                                             double inverse_sigma) {
  const auto aligned = AlignDepth(shutter, first, second, T_second_first, Matrix6d::Zero(), inverse_sigma);
  if (!aligned) return std::nullopt;
  const Matrix6d& hessian = aligned->information;
  DepthRotation out;
  out.rotation_rad = LogSE3(aligned->T_second_first).tail<3>();
  const Eigen::Matrix3d cross = hessian.topRightCorner<3, 3>();
  out.information =
      hessian.bottomRightCorner<3, 3>() -
      cross.transpose() * internal::Inverse(Eigen::Matrix3d(hessian.topLeftCorner<3, 3>())) * cross;
  return out;
}

}  // namespace tutti
