#include "frontend/odometry/step_check.h"

#include <algorithm>
#include <cmath>

#include "core/dense_solvers.h"
#include "frontend/map/measured.h"

namespace tutti {
namespace {

constexpr int kFewestPoints = 30;
constexpr double kFewestShare = 0.5;  // of the points that both see
constexpr double kVariances = 4;      // points of one image share their errors

// The keyframe's feature that sees a landmark; -1: none.
int FeatureOf(const Landmark& landmark, int keyframe) {
  const auto seen = std::lower_bound(landmark.observations.begin(), landmark.observations.end(), keyframe,
                                     [](const Observation& view, int id) { return view.keyframe < id; });
  return seen != landmark.observations.end() && seen->keyframe == keyframe ? seen->feature : -1;
}

// Of a landmark, in the keyframe's camera.
std::optional<Eigen::Vector3d> PointOf(const Landmark& landmark, const Keyframe& keyframe,
                                       const CameraRig& rig) {
  const int feature = FeatureOf(landmark, keyframe.id);
  if (feature < 0) return std::nullopt;
  if (rig.sensor == Sensor::kMono) return keyframe.T_world_camera.Inverse() * landmark.position;
  const auto f = static_cast<std::size_t>(feature);
  const double inverse_depth = keyframe.features->inverse_depth[f];
  if (!(inverse_depth > 0)) return std::nullopt;
  const cv::Point2f pixel = keyframe.features->keypoints[f].pt;
  return Eigen::Vector3d((pixel.x - rig.camera.cx) / rig.camera.fx, (pixel.y - rig.camera.cy) / rig.camera.fy,
                         1) /
         inverse_depth;
}

// Standard deviations of translation and rotation, the largest of the three axes each.
bool Sigmas(const PinholeCamera& camera, const std::vector<PointObservation>& points,
            const std::vector<char>& inlier, const Pose& pose, StepCheck* check) {
  Matrix6d information = Matrix6d::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    Eigen::Vector3d residual;
    Eigen::Matrix<double, 3, 6> by_pose;
    if (inlier[i] && ReprojectionResidual(camera, pose, points[i], &residual, &by_pose))
      information += by_pose.transpose() * by_pose;
  }
  const auto covariance = internal::InverseInformation(information);
  if (!covariance) return false;
  const Vector6d variances = kVariances * covariance->diagonal();
  check->sigma_translation_m = std::sqrt(variances.head<3>().maxCoeff());
  check->sigma_rotation_rad = std::sqrt(variances.tail<3>().maxCoeff());
  return true;
}

}  // namespace

std::optional<StepCheck> CheckStep(const Map& map, const CameraRig& rig, const OdometryOptions& options,
                                   int keyframe, const FrameFeatures& features,
                                   const std::vector<int>& landmarks, const Pose& T_camera_world,
                                   const Pose& T_seen_world) {
  const Keyframe& before = map.keyframe(keyframe);
  std::vector<PointObservation> points;
  for (std::size_t f = 0; f < landmarks.size(); ++f) {
    if (landmarks[f] < 0) continue;
    const auto point = PointOf(map.landmark(landmarks[f]), before, rig);
    if (!point) continue;
    const int feature = static_cast<int>(f);
    const double sigma = options.pixel_sigma * map.RelativeSigma(features, -1, feature, landmarks[f]);
    points.push_back(Measured(features, feature, *point, sigma));
  }
  if (static_cast<int>(points.size()) < kFewestPoints) return std::nullopt;
  const Pose given = T_camera_world * before.T_world_camera;
  Pose seen = T_seen_world * before.T_world_camera;
  std::vector<char> inlier;
  const int inliers = RefinePose(rig.camera, points, &seen, &inlier);
  if (inliers < kFewestPoints || inliers < kFewestShare * static_cast<double>(points.size()))
    return std::nullopt;
  StepCheck check;
  if (!Sigmas(rig.camera, points, inlier, seen, &check)) return std::nullopt;
  const Pose error = seen * given.Inverse();
  check.way_m = given.translation.norm();
  check.translation_m = error.translation;
  check.rotation_rad = LogSO3(error.rotation);
  return check;
}

}  // namespace tutti
