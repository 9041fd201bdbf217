#include "apps/dense/stages.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "core/numbers.h"

namespace tutti {
namespace {

constexpr double kBin = 0.05;  // of heights [m]

// Turned around from `start`, the mean of the normals within an angle that shrinks: the direction that most
// of them have.
Eigen::Vector3d LevelNormal(const PointCloud& surface, Eigen::Vector3d up) {
  for (const double degrees : {45.0, 30.0, 20.0, 10.0, 10.0}) {
    const double least = std::cos(degrees * internal::kRadians);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3f& normal : surface.normals) {
      const Eigen::Vector3d n = normal.cast<double>();
      if (n.dot(up) > least) sum += n;
    }
    if (sum.norm() > 0) up = sum.normalized();
  }
  return up;
}

// Points whose normal is within 10 degrees of up.
std::vector<Eigen::Vector3d> LevelPoints(const PointCloud& surface, const Eigen::Vector3d& up) {
  const double least = std::cos(10 * internal::kRadians);
  std::vector<Eigen::Vector3d> level;
  for (std::size_t i = 0; i < surface.points.size(); ++i) {
    if (surface.normals[i].cast<double>().dot(up) > least) level.push_back(surface.points[i].cast<double>());
  }
  return level;
}

// The height of the lowest plane below `below` that has at least a quarter as many points as the largest one.
double LowestLevel(const std::vector<Eigen::Vector3d>& level, const Eigen::Vector3d& up, double below,
                   bool* found) {
  std::map<long, std::size_t> bins;
  for (const Eigen::Vector3d& point : level) {
    const double height = up.dot(point);
    if (height < below) ++bins[std::lround(height / kBin)];
  }
  std::size_t most = 0;
  for (const auto& [bin, count] : bins) most = std::max(most, count);
  constexpr std::size_t kLeast = 100;  // points
  *found = most >= kLeast;
  for (const auto& [bin, count] : bins) {
    if (*found && 4 * count >= most) return static_cast<double>(bin) * kBin;
  }
  return bins.empty() ? below : static_cast<double>(bins.begin()->first) * kBin;
}

// Rotation into a frame with this z axis, whose x axis is as near to `forward` as can be.
Eigen::Matrix3d Upright(const Eigen::Vector3d& up, const Eigen::Vector3d& forward) {
  Eigen::Vector3d y = up.cross(forward);
  if (y.norm() < 1e-3) y = up.unitOrthogonal();  // the camera looked straight down
  y.normalize();
  Eigen::Matrix3d rows;
  rows << y.cross(up).transpose(), y.transpose(), up.transpose();
  return rows;
}

// Least squares: the plane z = a x + b y + c through the points within a bin of height 0, in the frame of T.
// Turns and shifts the frame so that it is z = 0.
Pose Levelled(const Pose& T_map_world, const std::vector<Eigen::Vector3d>& points) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d at = T_map_world * point;
    if (std::abs(at.z()) > kBin) continue;
    const Eigen::Vector3d row(at.x(), at.y(), 1);
    normal += row * row.transpose();
    right += at.z() * row;
  }
  const Eigen::Vector3d plane = normal.inverse() * right;
  if (!plane.allFinite() || plane.head<2>().norm() > 0.2) return T_map_world;
  const Eigen::Vector3d up = Eigen::Vector3d(-plane.x(), -plane.y(), 1).normalized();
  const Pose turn(Eigen::Quaterniond(Upright(up, Eigen::Vector3d::UnitX())), Eigen::Vector3d::Zero());
  return Pose(turn.rotation, turn.rotation * Eigen::Vector3d(0, 0, -plane.z())) * T_map_world;
}

}  // namespace

MapFrame2d FindMapFrame(const PointCloud& surface, const std::vector<Pose>& cameras) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Pose& T_world_camera : cameras) up -= T_world_camera.rotation * Eigen::Vector3d::UnitY();
  up = up.norm() > 0 ? Eigen::Vector3d(up.normalized()) : Eigen::Vector3d(-Eigen::Vector3d::UnitY());
  up = LevelNormal(surface, up);
  double lowest = up.dot(cameras.front().translation);
  for (const Pose& camera : cameras) lowest = std::min(lowest, up.dot(camera.translation));

  MapFrame2d frame;
  const std::vector<Eigen::Vector3d> level = LevelPoints(surface, up);
  const double ground = LowestLevel(level, up, lowest, &frame.ground_found);
  const Pose& first = cameras.front();
  const Eigen::Vector3d below = first.translation + (ground - up.dot(first.translation)) * up;
  const Eigen::Quaterniond R(Upright(up, first.rotation * Eigen::Vector3d::UnitZ()));
  frame.T_map_world = Pose(R, -(R * below));
  for (int i = 0; frame.ground_found && i < 3; ++i) frame.T_map_world = Levelled(frame.T_map_world, level);
  return frame;
}

}  // namespace tutti
