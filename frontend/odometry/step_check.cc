#include "frontend/odometry/step_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/features2d.hpp>

#include "core/dense_solvers.h"
#include "frontend/geometry/two_view.h"
#include "frontend/map/measured.h"

namespace tutti {
namespace {

constexpr int kFewestPoints = 30;
constexpr double kFewestShare = 0.5;  // of the points that both see
constexpr double kVariances = 4;      // points of one image share their errors
constexpr int kWatched = 12;          // keyframes after a thin one, or after a submap's first
constexpr int kThin = 3;              // times the fewest inliers of a pose: landmarks of a thin keyframe
constexpr std::array<int, 2> kBack = {2, 4};  // keyframes that a new one is compared with
constexpr float kAlike = 50;                  // bits
constexpr double kOnLine = 2;                 // distance from an epipolar line [px]
constexpr int kLeastAgreeing = 120;           // matches that an essential matrix fits, of both pairs
constexpr double kLeastByMap = 0.65;          // share of them that the map's poses fit
constexpr double kLeastNear = 0.9;            // or within twice the distance: the poses are only inexact

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

// The newest keyframes of a keyframe's submap, itself first; at most kWatched.
std::vector<int> Watched(const Map& map, int keyframe) {
  std::vector<int> newest;
  for (int id = keyframe; id >= 0 && static_cast<int>(newest.size()) < kWatched; --id) {
    const Keyframe& k = map.keyframe(id);
    if (k.piece == map.keyframe(keyframe).piece && k.replaced_by < 0) newest.push_back(id);
  }
  return newest;
}

// Few landmarks held its pose: those that were there before it.
bool IsThin(const Map& map, const Keyframe& keyframe, int min_inliers) {
  const auto held = std::count_if(keyframe.landmarks.begin(), keyframe.landmarks.end(), [&](int landmark) {
    return landmark >= 0 && map.landmark(landmark).reference < keyframe.id;
  });
  return held < kThin * min_inliers;
}

// The first two coordinates of rays (x/z, y/z, 1) to what two keyframes see, by their descriptors alone.
struct RayPairs {
  RayPairs(const PinholeCamera& camera, const FrameFeatures& a, const FrameFeatures& b) {
    if (a.size() == 0 || b.size() == 0) return;
    std::vector<cv::DMatch> mutual;
    cv::BFMatcher(cv::NORM_HAMMING, true).match(a.descriptors, b.descriptors, mutual);
    const auto ray = [&camera](const FrameFeatures& features, int f) {
      const cv::Point2f p = features.keypoints[static_cast<std::size_t>(f)].pt;
      return Eigen::Vector2d(camera.Unproject({p.x, p.y}).head<2>());
    };
    for (const cv::DMatch& match : mutual) {
      if (match.distance > kAlike) continue;
      first.push_back(ray(a, match.queryIdx));
      second.push_back(ray(b, match.trainIdx));
    }
  }

  // Whose Sampson distance is within the bound.
  int Agreeing(const Eigen::Matrix3d& essential, double bound) const {
    int count = 0;
    for (std::size_t i = 0; i < first.size(); ++i) {
      const Eigen::Vector3d a = first[i].homogeneous(), b = second[i].homogeneous();
      const Eigen::Vector3d of_a = essential * a, of_b = essential.transpose() * b;
      const double e = b.dot(of_a);
      count += e * e < bound * bound * (of_a.head<2>().squaredNorm() + of_b.head<2>().squaredNorm()) ? 1 : 0;
    }
    return count;
  }

  std::vector<Eigen::Vector2d> first, second;
};

// Matches that two essential matrices fit: that of the images, and that of the map's poses.
struct Agreement {
  void Add(const RayPairs& pairs, const Eigen::Matrix3d& by_images, const Eigen::Matrix3d& by_map,
           double bound) {
    images += pairs.Agreeing(by_images, bound);
    map += pairs.Agreeing(by_map, bound);
  }
  double ByMap() const { return static_cast<double>(map) / std::max(1, images); }

  int images = 0, map = 0;
};

}  // namespace

bool ImagesContradict(const Map& map, const PinholeCamera& camera, int keyframe, int min_inliers) {
  const std::vector<int> newest = Watched(map, keyframe);
  const bool begins = static_cast<int>(newest.size()) < kWatched;
  const auto thin = [&](int id) { return IsThin(map, map.keyframe(id), min_inliers); };
  if (!begins && std::none_of(newest.begin(), newest.end(), thin)) return false;
  const double bound = kOnLine / (0.5 * (camera.fx + camera.fy));
  Agreement on_line, near_line;
  for (const int back : kBack) {
    if (back >= static_cast<int>(newest.size())) break;
    const Keyframe &from = map.keyframe(newest[static_cast<std::size_t>(back)]), &to = map.keyframe(keyframe);
    const RayPairs pairs(camera, *from.features, *to.features);
    const auto fit = internal::FitEssential(pairs.first, pairs.second, bound, 0.999);
    if (!fit) continue;
    const Pose T_to_from = to.T_world_camera.Inverse() * from.T_world_camera;
    const Eigen::Matrix3d by_map = Skew(T_to_from.translation) * T_to_from.rotation.toRotationMatrix();
    on_line.Add(pairs, fit->matrix, by_map, bound);
    near_line.Add(pairs, fit->matrix, by_map, 2 * bound);
  }
  return on_line.images >= kLeastAgreeing && on_line.ByMap() < kLeastByMap && near_line.ByMap() < kLeastNear;
}

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
