#include "frontend/geometry/rolling_shutter.h"

namespace tutti {
namespace {

constexpr internal::GaussNewtonLimits kShutterLimits{10, 1e-7, 1e-5, 0};

}  // namespace

std::shared_ptr<const FrameFeatures> RollingShutter::Straighten(const FrameFeatures& seen,
                                                                const Vector6d& motion, double depth) const {
  auto out = std::make_shared<FrameFeatures>(seen);
  out->rolled.assign(seen.size(), cv::Point2f());
  for (std::size_t f = 0; f < seen.size(); ++f) {
    cv::KeyPoint& k = out->keypoints[f];
    const float inverse = seen.inverse_depth[f];
    const Eigen::Vector3d ray = camera_.Unproject({k.pt.x, k.pt.y});
    const Pose T_middle_row = ExpSE3(motion * -TimeOf(k.pt.y));
    const Eigen::Vector3d p = T_middle_row * (ray * (inverse > 0 ? 1.0 / double(inverse) : depth));
    if (!(p.z() > kMinDepth)) continue;
    const Eigen::Vector2d pixel = camera_.Project(p);
    const cv::Point2f moved(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
    out->rolled[f] = moved - k.pt;
    k.pt = moved;
    if (inverse > 0) out->inverse_depth[f] = static_cast<float>(1.0 / p.z());
  }
  out->BuildGrid(camera_.width, camera_.height);
  return out;
}

int RollingShutter::Refine(const std::vector<PointObservation>& observations, const MotionPrior& prior,
                           Pose* T_camera_world, Vector6d* motion, std::vector<char>* inlier) const {
  using Matrix3x12 = Eigen::Matrix<double, 3, 12>;
  *motion = prior.motion;
  const auto residual = [&](const PointObservation& o, Eigen::Vector3d* r, Matrix3x12* j) {
    const Pose then = ExpSE3(*motion * TimeOf(o.pixel.y())) * *T_camera_world;
    if (j == nullptr) return ReprojectionResidual(camera_, then, o, r, nullptr);
    Eigen::Matrix<double, 3, 6> by_pose;
    if (!ReprojectionResidual(camera_, then, o, r, &by_pose)) return false;
    *j << by_pose,
        by_pose * TimeOf(o.pixel.y());  // rows are near in time: their poses move as the middle one's
    return true;
  };
  const auto add_prior = [&](internal::NormalEquations<12>* equations) {
    prior.Add(*T_camera_world, *motion, equations);
  };
  const auto move = [&](const Eigen::Matrix<double, 12, 1>& step) {
    *T_camera_world = Pose(ExpSO3(step.segment<3>(3)), step.head<3>()) * *T_camera_world;
    *motion += step.tail<6>();
    return true;
  };
  const int inliers = RefineOnInliers<12>(observations, kShutterLimits, 6, residual, add_prior, move, inlier);
  if (T_camera_world->IsFinite() && motion->allFinite()) return inliers;
  inlier->assign(observations.size(), 0);
  return 0;
}

}  // namespace tutti
