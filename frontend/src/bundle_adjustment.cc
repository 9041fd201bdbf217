#include "tutti/frontend/bundle_adjustment.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>

#include "tutti/frontend/pose_solver.h"

namespace tutti {
namespace {

// A camera's parameters: a rotation vector relative to the rotation at the start, and the translation of
// T_camera_world. The rotation vector stays small, so it has no singularity, and no manifold is needed.
struct CameraBlock {
  Eigen::Quaterniond start;
  std::array<double, 6> parameters{};  // translation, rotation vector
  Pose T_camera_world() const {
    const Eigen::Map<const Eigen::Vector3d> t(parameters.data()), w(parameters.data() + 3);
    return Pose((ExpSO3(w) * start).normalized(), t);
  }
};

// Left Jacobian of SO(3) to third order; the rotation vector within one adjustment is far below 0.1 rad.
Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& w) {
  const Eigen::Matrix3d k = Skew(w);
  return Eigen::Matrix3d::Identity() + 0.5 * k + (1.0 / 6.0) * k * k + (1.0 / 24.0) * k * k * k;
}

// Reprojection of one landmark, whitened; N = 2 (pixel) or 3 (pixel and inverse depth) residuals.
template <int N>
class ReprojectionCost : public ceres::SizedCostFunction<N, 6, 3> {
 public:
  ReprojectionCost(const PinholeCamera* camera, const CameraBlock* block, const PointObservation& observation)
      : camera_(camera), block_(block), observation_(observation) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::Vector3d> t(parameters[0]), w(parameters[0] + 3), point(parameters[1]);
    const Eigen::Matrix3d rotation = (ExpSO3(w) * block_->start).toRotationMatrix();
    const Eigen::Vector3d turned = rotation * point;
    const Eigen::Vector3d p = turned + t;
    if (!(p.z() > 1e-3)) {
      // Behind the camera: a constant residual that the Huber loss bounds; the observation is removed
      // afterwards.
      for (int i = 0; i < N; ++i) residuals[i] = 1e3;
      if (jacobians != nullptr) {
        if (jacobians[0] != nullptr) std::fill(jacobians[0], jacobians[0] + N * 6, 0.0);
        if (jacobians[1] != nullptr) std::fill(jacobians[1], jacobians[1] + N * 3, 0.0);
      }
      return true;
    }
    const double iz = 1.0 / p.z(), x = p.x() * iz, y = p.y() * iz, wp = 1.0 / observation_.pixel_sigma;
    residuals[0] = wp * (camera_->fx * x + camera_->cx - observation_.pixel.x());
    residuals[1] = wp * (camera_->fy * y + camera_->cy - observation_.pixel.y());
    Eigen::Matrix<double, N, 3> d;
    d.row(0) << wp * camera_->fx * iz, 0, -wp * camera_->fx * x * iz;
    d.row(1) << 0, wp * camera_->fy * iz, -wp * camera_->fy * y * iz;
    if constexpr (N == 3) {
      const double wd = 1.0 / observation_.inverse_depth_sigma;
      residuals[2] = wd * (iz - observation_.inverse_depth);
      d.row(2) << 0, 0, -wd * iz * iz;
    }
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, N, 6, Eigen::RowMajor>> j(jacobians[0]);
      j.template leftCols<3>() = d;
      j.template rightCols<3>() = -d * Skew(turned) * LeftJacobian(w);
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, N, 3, Eigen::RowMajor>> j(jacobians[1]);
      j = d * rotation;
    }
    return true;
  }

 private:
  const PinholeCamera* camera_;
  const CameraBlock* block_;
  PointObservation observation_;
};

PointObservation Measurement(const Map& map, const Keyframe& k, int feature, double pixel_sigma) {
  const std::size_t f = static_cast<std::size_t>(feature);
  const cv::KeyPoint& keypoint = k.features->keypoints[f];
  PointObservation o;
  o.pixel = {keypoint.pt.x, keypoint.pt.y};
  o.pixel_sigma = pixel_sigma * map.scales()[static_cast<std::size_t>(keypoint.octave)];
  o.inverse_depth = k.features->inverse_depth[f];
  o.inverse_depth_sigma = o.inverse_depth > 0 ? k.features->inverse_depth_sigma[f] : 0;
  return o;
}

}  // namespace

BundleAdjustmentReport AdjustWindow(const PinholeCamera& camera, const std::vector<int>& moving,
                                    const std::vector<int>& fixed, const BundleAdjustmentOptions& options,
                                    Map* map) {
  BundleAdjustmentReport report;
  report.keyframes = static_cast<int>(moving.size());
  report.fixed = static_cast<int>(fixed.size());
  // Side by side in the order of the ids: Ceres orders the blocks of a group by their addresses, and blocks
  // scattered over the heap would make the last bits depend on what else the process does.
  std::vector<CameraBlock> blocks;
  blocks.reserve(moving.size() + fixed.size());
  std::map<int, CameraBlock*> cameras;
  for (const std::vector<int>* set : {&moving, &fixed}) {
    for (int id : *set) {
      const Pose T = map->keyframe(id).T_world_camera.Inverse();
      CameraBlock*& entry = cameras[id];
      if (entry == nullptr) entry = &blocks.emplace_back();
      CameraBlock& block = *entry;
      block.start = T.rotation;
      Eigen::Map<Eigen::Vector3d>(block.parameters.data()) = T.translation;
    }
  }
  std::vector<int> landmarks;
  for (int id : moving) {
    for (int l : map->keyframe(id).landmarks) {
      if (l >= 0) landmarks.push_back(l);
    }
  }
  std::sort(landmarks.begin(), landmarks.end());
  landmarks.erase(std::unique(landmarks.begin(), landmarks.end()), landmarks.end());
  report.landmarks = static_cast<int>(landmarks.size());
  if (landmarks.empty() || moving.empty()) return report;

  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.enable_fast_removal = false;
  problem_options.disable_all_safety_checks = true;
  ceres::HuberLoss huber2(std::sqrt(5.991)), huber3(std::sqrt(7.815));
  ceres::Problem problem(problem_options);
  auto* ordering = new ceres::ParameterBlockOrdering;
  std::vector<std::array<double, 3>> points(landmarks.size());
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const Landmark& l = map->landmark(landmarks[i]);
    Eigen::Map<Eigen::Vector3d>(points[i].data()) = l.position;
    bool used = false;
    for (const Observation& o : l.observations) {
      const auto block = cameras.find(o.keyframe);
      if (block == cameras.end()) continue;
      const PointObservation m = Measurement(*map, map->keyframe(o.keyframe), o.feature, options.pixel_sigma);
      if (m.inverse_depth_sigma > 0) {
        problem.AddResidualBlock(new ReprojectionCost<3>(&camera, block->second, m), &huber3,
                                 block->second->parameters.data(), points[i].data());
      } else {
        problem.AddResidualBlock(new ReprojectionCost<2>(&camera, block->second, m), &huber2,
                                 block->second->parameters.data(), points[i].data());
      }
      used = true;
      ++report.observations;
    }
    if (used) ordering->AddElementToGroup(points[i].data(), 0);
  }
  for (const auto& [id, block] : cameras) {
    if (!problem.HasParameterBlock(block->parameters.data())) continue;
    ordering->AddElementToGroup(block->parameters.data(), 1);
    if (std::binary_search(fixed.begin(), fixed.end(), id))
      problem.SetParameterBlockConstant(block->parameters.data());
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.linear_solver_ordering.reset(ordering);
  solver.max_num_iterations = options.iterations;
  solver.function_tolerance = 1e-5;  // at 1e-4 the result depends on where the axes of the world point
  solver.parameter_tolerance = 1e-9;
  solver.num_threads = 1;  // more threads change the last bits
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  report.initial_cost = summary.initial_cost;
  report.final_cost = summary.final_cost;
  report.usable = summary.IsSolutionUsable() && std::isfinite(summary.final_cost);
  if (!report.usable) return report;

  for (int id : moving) {
    const Pose T = cameras.at(id)->T_camera_world();
    if (T.IsFinite()) map->keyframe(id).T_world_camera = T.Inverse();
  }
  std::vector<std::pair<int, int>> misfits;  // landmark, keyframe
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    Landmark& l = map->landmark(landmarks[i]);
    const Eigen::Map<Eigen::Vector3d> p(points[i].data());
    if (p.allFinite()) l.position = p;
    for (const Observation& o : l.observations) {
      if (cameras.find(o.keyframe) == cameras.end()) continue;
      const Keyframe& k = map->keyframe(o.keyframe);
      PointObservation m = Measurement(*map, k, o.feature, options.pixel_sigma);
      m.point = l.position;
      Eigen::Vector3d r;
      if (!ReprojectionResidual(camera, k.T_world_camera.Inverse(), m, &r, nullptr) ||
          r.squaredNorm() > ChiSquareBound(m)) {
        misfits.emplace_back(landmarks[i], o.keyframe);
      }
    }
  }
  for (const auto& [landmark, keyframe] : misfits) map->RemoveObservation(landmark, keyframe);
  report.removed = static_cast<int>(misfits.size());
  for (int id : landmarks) {
    const Landmark& l = map->landmark(id);
    if (!l.alive) continue;
    const bool has_depth =
        std::any_of(l.observations.begin(), l.observations.end(), [&](const Observation& o) {
          return map->keyframe(o.keyframe).features->inverse_depth[static_cast<std::size_t>(o.feature)] > 0;
        });
    if (l.observations.size() < 2 && !has_depth) {
      map->RemoveLandmark(id);
    } else {
      map->UpdateLandmark(id);
    }
  }
  return report;
}

BundleAdjustmentReport AdjustLocally(const PinholeCamera& camera, int keyframe,
                                     const BundleAdjustmentOptions& options, Map* map) {
  std::vector<int> moving = map->BestCovisible(keyframe, options.keyframes - 1, 15);
  moving.push_back(keyframe);
  std::sort(moving.begin(), moving.end());
  std::map<int, int> votes;  // keyframes outside the window -> common landmarks
  for (int id : moving) {
    for (int l : map->keyframe(id).landmarks) {
      if (l < 0) continue;
      for (const Observation& o : map->landmark(l).observations) {
        if (!std::binary_search(moving.begin(), moving.end(), o.keyframe)) ++votes[o.keyframe];
      }
    }
  }
  std::vector<std::pair<int, int>> order;
  for (const auto& [id, count] : votes) order.emplace_back(-count, id);
  std::sort(order.begin(), order.end());
  std::vector<int> fixed;
  for (const auto& [count, id] : order) {
    if (static_cast<int>(fixed.size()) >= options.fixed_keyframes) break;
    fixed.push_back(id);
  }
  // Without outside help the oldest keyframes of the window fix the gauge: one pose, and for mono the scale
  // by a second.
  const std::size_t needed = options.metric ? 1 : 2;
  while (fixed.size() < needed && moving.size() > 1) {
    fixed.push_back(moving.front());
    moving.erase(moving.begin());
  }
  std::sort(fixed.begin(), fixed.end());
  return AdjustWindow(camera, moving, fixed, options, map);
}

}  // namespace tutti
