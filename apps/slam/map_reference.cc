#include "apps/slam/map_reference.h"

#include <cstddef>
#include <utility>
#include <vector>

#include "core/numbers.h"

namespace tutti {
namespace {

// How much farther away `now` sees than `before` saw, the median over landmarks of both; 1 without any.
double Growth(const KeyframeView& before, const KeyframeView& now) {
  std::vector<double> ratios;
  for (std::size_t f = 0; f < before.landmarks.size() && f < now.landmarks.size(); ++f) {
    if (before.landmarks[f] < 0 || now.landmarks[f] < 0) continue;
    const double was = before.points[f].z(), is = now.points[f].z();
    if (was > 0 && is > 0) ratios.push_back(is / was);
  }
  return ratios.empty() ? 1 : internal::Median(std::move(ratios));
}

}  // namespace

std::map<int, Similarity> InFrameOf(const Map& first, int first_keyframe, const Map& merged) {
  std::map<int, Similarity> S_first_piece;
  for (const int id : first.KeyframeIds()) {
    const KeyframeView now = ViewOf(merged, first_keyframe + id);
    if (S_first_piece.count(now.map_piece) != 0) continue;
    const KeyframeView before = ViewOf(first, id);
    Similarity S_camera_now = Similarity(now.T_world_camera).Inverse();
    if (first.rig().sensor == Sensor::kMono) {
      const double scale = 1 / Growth(before, now);
      S_camera_now.scale = scale;
      S_camera_now.translation *= scale;
    }
    S_first_piece[now.map_piece] = Similarity(before.T_world_camera) * S_camera_now;
  }
  std::map<int, Similarity> S_first_keyframe;
  for (const int id : merged.KeyframeIds()) {
    const auto moved = S_first_piece.find(merged.keyframe(id).piece);
    if (moved != S_first_piece.end())
      S_first_keyframe[id] = moved->second * Similarity(merged.keyframe(id).T_world_camera);
  }
  return S_first_keyframe;
}

std::optional<Pose> UprightTurn(const Odometry& odometry) {
  const std::optional<ImuReport> imu = odometry.Report().imu;
  if (!imu || !imu->up) return std::nullopt;
  return Pose(Eigen::Quaterniond::FromTwoVectors(*imu->up, Eigen::Vector3d::UnitZ()),
              Eigen::Vector3d::Zero());
}

}  // namespace tutti
