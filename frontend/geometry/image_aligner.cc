#include "frontend/geometry/image_aligner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/reprojection.h"
#include "frontend/features/grey_window.h"

namespace tutti {
namespace {

constexpr int kHalfSquare = 1;  // of the square that is compared [px of the level]
constexpr int kSamples = (2 * kHalfSquare + 1) * (2 * kHalfSquare + 1);
constexpr int kLeastPoints = 60;
constexpr int kAlignerIterations = 12;
constexpr double kSampleSigma = 8;       // of what a sample may differ by [grey levels]; beyond, Huber's loss
constexpr double kLeastExplained = 0.5;  // of the variance of the samples
constexpr internal::GaussNewtonLimits kAlignerLimits{kAlignerIterations, 1e-5, 1e-4, 1e-9};
constexpr int kUnknowns = 13;  // pose, motion, brightness

// The pyramid and two coarser levels, each half as large as the one before.
std::vector<cv::Mat> Coarse(const std::vector<cv::Mat>& pyramid) {
  std::vector<cv::Mat> levels = pyramid;
  for (int i = 0; i < 2 && levels.back().cols >= 48 && levels.back().rows >= 48; ++i) {
    cv::Mat half;
    cv::resize(levels.back(), half, cv::Size(levels.back().cols / 2, levels.back().rows / 2), 0, 0,
               cv::INTER_AREA);
    levels.push_back(half);
  }
  return levels;
}

Eigen::Vector2d PixelOfLevel(const Eigen::Vector2d& pixel, const Eigen::Vector2d& scale) {
  return ((pixel.array() + 0.5) / scale.array() - 0.5).matrix();
}

bool Inside(const cv::Mat& image, const Eigen::Vector2d& p) {
  return p.x() >= 2 && p.y() >= 2 && p.x() < image.cols - 3 && p.y() < image.rows - 3;
}

struct Point {
  Eigen::Vector3d in_world;
  Eigen::Vector2d pixel;  // where the reference image has it [px]
  Eigen::Vector3d in_reference;
};

}  // namespace

// One level of the pyramid: what the reference shows, and the fit.
class ImageAligner::Level {
 public:
  Level(const ImageAligner& aligner, const cv::Mat& from, const cv::Mat& to, const cv::Size& whole)
      : camera_(aligner.camera_), shutter_(aligner.shutter_), from_(from), to_(to) {
    scale_ = {double(whole.width) / from.cols, double(whole.height) / from.rows};
  }

  // `T_reference_world`: that the squares are turned from.
  void Prepare(const std::vector<Point>& points, const Pose& T_reference_world, const CameraMotion& start) {
    const Eigen::Matrix3d turned =
        (start.T_camera_world.rotation * T_reference_world.rotation.conjugate()).toRotationMatrix();
    for (const Point& point : points) {
      const Eigen::Vector2d p = PixelOfLevel(point.pixel, scale_);
      if (!Inside(from_, p)) continue;
      const Eigen::Vector3d q = start.T_camera_world * point.in_world;
      Eigen::Vector2d unused;
      internal::Reprojection<2>::PointJacobian projection;
      if (!internal::Reprojection<2>::Residual(camera_, q, {Eigen::Vector2d::Zero()}, kMinDepth, &unused,
                                               &projection))
        continue;
      Eigen::Matrix<double, 3, 2> lift;
      lift << point.in_reference.z() / camera_.fx, 0, 0, point.in_reference.z() / camera_.fy, 0, 0;
      Target target{point.in_world, projection * turned * lift, {}};
      for (int v = -kHalfSquare, n = 0; v <= kHalfSquare; ++v) {
        for (int u = -kHalfSquare; u <= kHalfSquare; ++u, ++n)
          target.grey[static_cast<std::size_t>(n)] =
              Bilinear(from_.data, from_.step, static_cast<float>(p.x() + u), static_cast<float>(p.y() + v));
      }
      targets_.push_back(target);
    }
  }

  // False if it led nowhere.
  bool Fit(const MotionPrior& prior, CameraMotion* now, double* brightness, double* explained) const {
    const auto linearise = [&](internal::NormalEquations<kUnknowns>& equations) {
      Sums sums;
      for (const Target& target : targets_) Add(target, *now, *brightness, &equations, &sums);
      prior.Add(now->T_camera_world, now->motion, &equations);
      equations.hessian(12, 12) += 1e-3;
      *explained = sums.Explained();
    };
    const auto move = [&](const Eigen::Matrix<double, kUnknowns, 1>& step) {
      now->T_camera_world = Pose(ExpSO3(step.segment<3>(3)), step.head<3>()) * now->T_camera_world;
      now->motion += step.segment<6>(6);
      *brightness += step(12);
      return now->T_camera_world.IsFinite();
    };
    return static_cast<int>(targets_.size()) >= kLeastPoints &&
           internal::GaussNewton<kUnknowns>(kAlignerLimits, linearise, move);
  }

 private:
  struct Target {
    Eigen::Vector3d in_world;
    Eigen::Matrix2d A;  // how offsets in the reference map to offsets in the image
    std::array<float, kSamples> grey;
  };
  struct Sums {
    double squares = 0, grey = 0, grey2 = 0;
    int samples = 0, points = 0;
    double Explained() const {
      if (points < kLeastPoints) return 0;
      return 1 - squares / std::max(1.0, grey2 - grey * grey / samples);
    }
  };

  void Add(const Target& target, const CameraMotion& now, double brightness,
           internal::NormalEquations<kUnknowns>* equations, Sums* sums) const {
    const Eigen::Vector3d middle = now.T_camera_world * target.in_world;
    Eigen::Vector3d p = middle;
    double time = 0;
    for (int i = 0; i < (shutter_.Rolls() ? 3 : 1); ++i) {  // the row is read when it has the point
      if (!(p.z() > kMinDepth)) return;
      if (!shutter_.Rolls()) break;
      time = shutter_.TimeOf(std::clamp(camera_.Project(p).y(), 0.0, camera_.height - 1.0));
      p = ExpSE3(now.motion * time) * middle;
    }
    Eigen::Vector2d pixel;
    internal::Reprojection<2>::PointJacobian by_point;
    if (!internal::Reprojection<2>::Residual(camera_, p, {Eigen::Vector2d::Zero()}, kMinDepth, &pixel,
                                             &by_point))
      return;
    const Eigen::Vector2d at = PixelOfLevel(pixel, scale_);
    if (!Inside(to_, at)) return;
    Eigen::Matrix2d gg = Eigen::Matrix2d::Zero();
    Eigen::Vector2d g_sum = Eigen::Vector2d::Zero(), gr = Eigen::Vector2d::Zero();
    double r_sum = 0, w_sum = 0;
    constexpr double kUnit = 1 / (kSampleSigma * kSampleSigma * kSamples);  // neighbours say about the same
    for (int v = -kHalfSquare, n = 0; v <= kHalfSquare; ++v) {
      for (int u = -kHalfSquare; u <= kHalfSquare; ++u, ++n) {
        const Eigen::Vector2d q = at + target.A * Eigen::Vector2d(u, v);
        if (!Inside(to_, q)) continue;
        const float x = static_cast<float>(q.x()), y = static_cast<float>(q.y());
        const double here = Bilinear(to_.data, to_.step, x, y);
        const double before = target.grey[static_cast<std::size_t>(n)];
        const Eigen::Vector2d g(
            0.5 * (Bilinear(to_.data, to_.step, x + 1, y) - Bilinear(to_.data, to_.step, x - 1, y)),
            0.5 * (Bilinear(to_.data, to_.step, x, y + 1) - Bilinear(to_.data, to_.step, x, y - 1)));
        const double r = here - before - brightness;
        const double w = kUnit * internal::HuberWeight(r * r, kSampleSigma * kSampleSigma);
        gg += w * g * g.transpose();
        gr += w * r * g;
        g_sum += w * g;
        r_sum += w * r;
        w_sum += w;
        equations->cost += kUnit * internal::HuberCost(r * r, kSampleSigma * kSampleSigma);
        sums->squares += r * r;
        sums->grey += before;
        sums->grey2 += before * before;
        ++sums->samples;
      }
    }
    ++sums->points;
    const Eigen::Matrix<double, 2, 6> by_pose =
        scale_.cwiseInverse().asDiagonal() * internal::Reprojection<2>::ByPose(by_point, p);
    Eigen::Matrix<double, 2, 12> j;
    j << by_pose, by_pose * time;
    equations->hessian.topLeftCorner<12, 12>().noalias() += j.transpose() * gg * j;
    equations->gradient.head<12>().noalias() += j.transpose() * gr;
    const Eigen::Matrix<double, 12, 1> cross = -j.transpose() * g_sum;
    equations->hessian.topRightCorner<12, 1>() += cross;
    equations->hessian.bottomLeftCorner<1, 12>() += cross.transpose();
    equations->hessian(12, 12) += w_sum;
    equations->gradient(12) -= r_sum;
  }

  const PinholeCamera& camera_;
  const RollingShutter& shutter_;
  cv::Mat from_, to_;
  Eigen::Vector2d scale_;
  std::vector<Target> targets_;
};

std::optional<CameraMotion> ImageAligner::Align(const Reference& reference, const FrameFeatures& seen,
                                                const CameraMotion& start, const MotionPrior& prior) const {
  const FrameFeatures& from = *reference.features;
  if (!from.pyramid || !seen.pyramid || from.pyramid->size() != seen.pyramid->size() || seen.pyramid->empty())
    return std::nullopt;
  std::vector<Point> points;
  const Pose T_world_reference = reference.T_camera_world.Inverse();
  for (std::size_t f = 0; f < from.size(); ++f) {
    if (!(reference.depth[f] > 0)) continue;
    const cv::Point2f& at = from.keypoints[f].pt;
    const Eigen::Vector3d p = camera_.Unproject({at.x, at.y}) * reference.depth[f];
    points.push_back({T_world_reference * p, Eigen::Vector2d(at.x, at.y) - from.Rolled(f), p});
  }
  if (static_cast<int>(points.size()) < kLeastPoints) return std::nullopt;
  const std::vector<cv::Mat> old = Coarse(*from.pyramid), now = Coarse(*seen.pyramid);
  CameraMotion found = start;
  double brightness = 0, explained = 0;
  const cv::Size whole = old[0].size();
  const std::size_t top = from.pyramid->size() - 1, fine = top >= 3 ? top - 3 : 0;
  for (const std::size_t l : {old.size() - 1, old.size() - 2, top, fine}) {
    if (l >= old.size()) continue;
    Level level(*this, old[l], now[l], whole);
    level.Prepare(points, reference.T_camera_world, found);
    if (!level.Fit(prior, &found, &brightness, &explained)) return std::nullopt;
  }
  if (!(explained > kLeastExplained)) return std::nullopt;
  return found;
}

}  // namespace tutti
