#include "frontend/geometry/image_aligner.h"

#include <algorithm>
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
constexpr double kSampleSigma = 8;       // of what a sample may differ by [grey levels]; beyond, Huber's loss
constexpr double kLeastExplained = 0.5;  // of the variance of the samples
constexpr internal::GaussNewtonLimits kAlignerLimits{12, 1e-5, 1e-4, 1e-9};
constexpr int kUnknowns = 13;  // pose, motion, brightness
constexpr std::size_t kMostPoints = 1000;
constexpr int kLeastContrast = 3;     // of what is worth a look [grey levels]
constexpr double kLongestHalf = 40;   // of a streak [px of the level]
constexpr double kOtherDepth = 0.05;  // [1/m]
constexpr double kLeastArea = 0.1;    // of a square after its turn, of what it was

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

}  // namespace

// The way of a point through the image while it is exposed, from -1 to 1 [px of the level].
struct ImageAligner::Streak {
  Eigen::Vector2d straight = {0, 0}, curved = {0, 0};

  Eigen::Vector2d At(double t) const { return t * straight + t * t * curved; }
  Streak Mapped(const Eigen::Matrix2d& by) const { return {by * straight, by * curved}; }
  // Places along it at which grey values are read, one a pixel.
  int Samples() const {
    constexpr double kMost = 40;
    const int n = static_cast<int>(std::min(kMost, std::ceil(2 * straight.norm())));
    return n < 1 ? 1 : n + 1;
  }
  Eigen::Vector2d Sample(int k, int samples) const {
    return samples == 1 ? Eigen::Vector2d(0, 0) : At(2.0 * (k + 0.5) / samples - 1);
  }
  bool IsInside(const cv::Mat& image, const Eigen::Vector2d& at) const {
    const Eigen::Vector2d most = straight.cwiseAbs() + curved.cwiseAbs();  // a curve may turn back within it
    return Inside(image, at - most) && Inside(image, at + most);
  }
};

struct ImageAligner::Point {
  Eigen::Vector3d in_world;
  Eigen::Vector2d pixel;  // where the reference image has it [px]
  Eigen::Vector3d in_reference;
};

// One level of the pyramid: what the reference shows, and the fit.
class ImageAligner::Level {
 public:
  Level(const ImageAligner& aligner, const cv::Mat& from, const cv::Mat& to, const cv::Size& whole)
      : camera_(aligner.camera_), shutter_(aligner.shutter_), from_(from), to_(to) {
    scale_ = {double(whole.width) / from.cols, double(whole.height) / from.rows};
  }

  // `reference`: that the squares are turned from.
  void Prepare(const std::vector<Point>& points, const DepthGrid* grid, const CameraMotion& reference,
               const CameraMotion& start, double exposure_s) {
    const Eigen::Matrix3d turned =
        (start.T_camera_world.rotation * reference.T_camera_world.rotation.conjugate()).toRotationMatrix();
    for (const std::size_t i : Best(points)) {
      const Point& point = points[i];
      const Eigen::Vector2d p = PixelOfLevel(point.pixel, scale_);
      const Eigen::Vector3d q = start.T_camera_world * point.in_world;
      Eigen::Vector2d unused;
      internal::Reprojection<2>::PointJacobian projection;
      if (!internal::Reprojection<2>::Residual(camera_, q, {Eigen::Vector2d::Zero()}, kMinDepth, &unused,
                                               &projection))
        continue;
      Eigen::Matrix<double, 3, 2> lift;
      lift << point.in_reference.z() / camera_.fx, 0, 0, point.in_reference.z() / camera_.fy, 0, 0;
      Target target;
      target.in_world = point.in_world;
      target.A = projection * turned * lift;
      if (!(std::abs(target.A.determinant()) > kLeastArea)) continue;
      const std::optional<Streak> here = StreakOf(q, start, exposure_s),
                                  there = StreakOf(point.in_reference, reference, exposure_s);
      if (!here || !there) continue;
      const Eigen::Matrix2d back = target.A.inverse();
      const Streak blur = here->Mapped(back);
      if (!blur.IsInside(from_, p) || !(OneDepth(point, grid, blur) && OneDepth(point, grid, *there)))
        continue;
      target.streak = there->Mapped(target.A);
      Show(p, blur, back, &target);
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

  // Sum of square differences, by that of the squares' own contrasts; 0: too little is in view.
  double Misfit(const CameraMotion& now) const {
    internal::NormalEquations<kUnknowns> unused;
    Sums sums;
    for (const Target& target : targets_) Add(target, now, 0, &unused, &sums);
    double contrast = 0;  // what blurs more shows less, and differs by less
    for (const Target& target : targets_) {
      const Eigen::Map<const Eigen::Array<float, kSamples, 1>> grey(target.grey.data());
      contrast += double((grey - grey.mean()).square().sum());
    }
    return sums.points < kLeastPoints || !(contrast > 0) ? 0 : sums.squares / contrast;
  }

 private:
  struct Target {
    Eigen::Vector3d in_world;
    Eigen::Matrix2d A;                 // how offsets in the reference map to offsets in the image
    Streak streak;                     // by which the reference is blurred, in the image
    std::array<float, kSamples> grey;  // of the reference, blurred as the image is
    std::array<Eigen::Vector2d, kSamples> gradient;  // in the image
  };
  struct Sums {
    double squares = 0, grey = 0, grey2 = 0;
    int samples = 0, points = 0;
    double Explained() const {
      if (points < kLeastPoints) return 0;
      return 1 - squares / std::max(1.0, grey2 - grey * grey / samples);
    }
  };

  // `p`: in the camera at the middle row's time.
  std::optional<Streak> StreakOf(const Eigen::Vector3d& middle, const CameraMotion& camera,
                                 double exposure_s) const {
    if (!(exposure_s > 0)) return Streak();
    double time = 0;
    const Eigen::Vector3d p = WhenRead(camera, middle, &time);
    const Eigen::Vector3d later = camera.Then(time, 0.5 * exposure_s) * p,
                          earlier = camera.Then(time, -0.5 * exposure_s) * p;
    if (!(later.z() > kMinDepth) || !(p.z() > kMinDepth) || !(earlier.z() > kMinDepth)) return std::nullopt;
    const Eigen::Vector2d to = camera_.Project(later), from = camera_.Project(earlier);
    const Streak streak{(0.5 * (to - from)).cwiseQuotient(scale_),
                        (0.5 * (to + from) - camera_.Project(p)).cwiseQuotient(scale_)};
    if (!(streak.straight.norm() + streak.curved.norm() < kLongestHalf)) return std::nullopt;
    return streak;
  }

  // A point in the camera when its row is read, and when that is, from where it is in the middle row's time.
  Eigen::Vector3d WhenRead(const CameraMotion& camera, const Eigen::Vector3d& middle, double* time) const {
    Eigen::Vector3d p = middle;
    for (int i = 0; shutter_.Rolls() && i < 3 && p.z() > kMinDepth; ++i) {
      *time = shutter_.TimeOf(std::clamp(camera_.Project(p).y(), 0.0, camera_.height - 1.0));
      p = camera.Then(*time) * middle;
    }
    return p;
  }

  // Points that the reference shows with most contrast, in their order. A flat surface has none when blurred.
  std::vector<std::size_t> Best(const std::vector<Point>& points) const {
    std::vector<std::pair<int, std::size_t>> order;  // by contrast, most first
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d p = PixelOfLevel(points[i].pixel, scale_);
      const int contrast = Inside(from_, p) ? Contrast(p) : 0;
      if (contrast >= kLeastContrast) order.emplace_back(-contrast, i);
    }
    if (order.size() > kMostPoints) {
      std::nth_element(order.begin(), order.begin() + kMostPoints, order.end());
      order.resize(kMostPoints);
    }
    std::vector<std::size_t> best;
    best.reserve(order.size());
    for (const auto& [contrast, i] : order) best.push_back(i);
    std::sort(best.begin(), best.end());
    return best;
  }
  int Contrast(const Eigen::Vector2d& p) const {
    int least = 255, most = 0;
    const int x = static_cast<int>(std::lround(p.x())), y = static_cast<int>(std::lround(p.y()));
    for (int v = -kHalfSquare; v <= kHalfSquare; ++v) {
      for (int u = -kHalfSquare; u <= kHalfSquare; ++u) {
        const int grey = from_.at<std::uint8_t>(y + v, x + u);
        least = std::min(least, grey);
        most = std::max(most, grey);
      }
    }
    return most - least;
  }

  // True if nothing that is much nearer or farther than the point lies along the streak, as far as is known:
  // it would move in another way.
  bool OneDepth(const Point& point, const DepthGrid* grid, const Streak& streak) const {
    if (grid == nullptr) return true;
    const int n = static_cast<int>(streak.straight.cwiseProduct(scale_).norm() / grid->step) + 1;
    for (int k = -n; k <= n; ++k) {
      const float other = grid->Near(point.pixel + streak.At(double(k) / n).cwiseProduct(scale_));
      if (other > 0 && std::abs(double(other) - 1 / point.in_reference.z()) > kOtherDepth) return false;
    }
    return true;
  }

  // The square of the reference around `p`, and its gradient.
  void Show(const Eigen::Vector2d& p, const Streak& blur, const Eigen::Matrix2d& back, Target* target) const {
    constexpr int kBorder = kHalfSquare + 1, kSide = 2 * kBorder + 1;
    GreyWindow<kBorder> around = GreyWindow<kBorder>::Zero(), once;
    const int samples = blur.Samples();
    for (int k = 0; k < samples; ++k) {
      const Eigen::Vector2d q = p + blur.Sample(k, samples);
      BilinearWindow<kBorder>(from_.data, from_.step, static_cast<float>(q.x()), static_cast<float>(q.y()),
                              &once);
      around += once;
    }
    around /= static_cast<float>(samples);
    for (int v = 0, n = 0; v < kSide - 2; ++v) {
      for (int u = 0; u < kSide - 2; ++u, ++n) {
        const auto at = [&](int x, int y) { return double(around(y * kSide + x)); };
        const Eigen::Vector2d g(0.5 * (at(u + 2, v + 1) - at(u, v + 1)),
                                0.5 * (at(u + 1, v + 2) - at(u + 1, v)));
        target->grey[static_cast<std::size_t>(n)] = static_cast<float>(at(u + 1, v + 1));
        target->gradient[static_cast<std::size_t>(n)] = back.transpose() * g;
      }
    }
  }

  // The square of the image around `at`, blurred as the reference is.
  std::array<float, kSamples> Blurred(const Eigen::Vector2d& at, const Target& target) const {
    std::array<float, kSamples> grey{};
    const int samples = target.streak.Samples();
    const float right = static_cast<float>(to_.cols) - 1.01F, bottom = static_cast<float>(to_.rows) - 1.01F;
    for (int k = 0; k < samples; ++k) {
      const Eigen::Vector2d middle = at + target.streak.Sample(k, samples);
      for (int v = -kHalfSquare, n = 0; v <= kHalfSquare; ++v) {
        for (int u = -kHalfSquare; u <= kHalfSquare; ++u, ++n) {
          const Eigen::Vector2d q = middle + target.A * Eigen::Vector2d(u, v);
          grey[static_cast<std::size_t>(n)] +=
              Bilinear(to_.data, to_.step, std::clamp(static_cast<float>(q.x()), 0.0F, right),
                       std::clamp(static_cast<float>(q.y()), 0.0F, bottom));
        }
      }
    }
    for (float& g : grey) g /= static_cast<float>(samples);
    return grey;
  }

  void Add(const Target& target, const CameraMotion& now, double brightness,
           internal::NormalEquations<kUnknowns>* equations, Sums* sums) const {
    double time = 0;
    const Eigen::Vector3d p = WhenRead(now, now.T_camera_world * target.in_world, &time);
    if (!(p.z() > kMinDepth)) return;
    Eigen::Vector2d pixel;
    internal::Reprojection<2>::PointJacobian by_point;
    if (!internal::Reprojection<2>::Residual(camera_, p, {Eigen::Vector2d::Zero()}, kMinDepth, &pixel,
                                             &by_point))
      return;
    const Eigen::Vector2d at = PixelOfLevel(pixel, scale_);
    if (!Inside(to_, at) || !target.streak.IsInside(to_, at)) return;
    const std::array<float, kSamples> seen = Blurred(at, target);
    Eigen::Matrix2d gg = Eigen::Matrix2d::Zero();
    Eigen::Vector2d g_sum = Eigen::Vector2d::Zero(), gr = Eigen::Vector2d::Zero();
    double r_sum = 0, w_sum = 0;
    constexpr double kUnit = 1 / (kSampleSigma * kSampleSigma * kSamples);  // neighbours say about the same
    for (std::size_t n = 0; n < kSamples; ++n) {
      const double before = double(target.grey[n]), r = double(seen[n]) - before - brightness;
      const Eigen::Vector2d& g = target.gradient[n];
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
    }
    sums->samples += kSamples;
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

std::vector<ImageAligner::Point> ImageAligner::PointsOf(const Reference& reference) const {
  std::vector<Point> points;
  const FrameFeatures& from = *reference.features;
  const Pose T_world_reference = reference.camera.T_camera_world.Inverse();
  for (std::size_t f = 0; f < from.size() && !from.depth_grid; ++f) {
    if (!(reference.depth[f] > 0)) continue;
    const cv::Point2f& at = from.keypoints[f].pt;
    const Eigen::Vector3d p = camera_.Unproject({at.x, at.y}) * reference.depth[f];
    points.push_back({T_world_reference * p, Eigen::Vector2d(at.x, at.y) - from.Rolled(f), p});
  }
  if (!from.depth_grid) return points;
  const DepthGrid& grid = *from.depth_grid;
  for (int r = 0; r < grid.Rows(); ++r) {
    for (int c = 0; c < grid.columns; ++c) {
      const float inverse = grid.At(r, c);
      if (!(inverse > 0)) continue;
      const Eigen::Vector2d pixel = grid.PixelOf(r, c);
      Eigen::Vector3d p = camera_.Unproject(pixel) / double(inverse);
      if (shutter_.Rolls()) p = reference.camera.Then(shutter_.TimeOf(pixel.y())).Inverse() * p;
      if (p.z() > kMinDepth) points.push_back({T_world_reference * p, pixel, p});
    }
  }
  return points;
}

namespace {

bool HaveImages(const FrameFeatures& from, const FrameFeatures& seen) {
  return from.pyramid && seen.pyramid && !seen.pyramid->Levels().empty() &&
         from.pyramid->Levels().size() == seen.pyramid->Levels().size();
}

// The finest level that is compared.
std::size_t Finest(const std::vector<cv::Mat>& pyramid) {
  const std::size_t top = pyramid.size() - 1;
  return top >= 3 ? top - 3 : 0;
}

}  // namespace

// From the step between two frames, and the one before, how both cameras moved while they exposed.
void ImageAligner::MoveOn(const Reference& from, CameraMotion* reference, CameraMotion* now) const {
  if (!(from.since_s > 0)) return;
  const Vector6d step = LogSE3(now->T_camera_world * reference->T_camera_world.Inverse()) / from.since_s;
  if (!from.step) {
    if (!shutter_.RowsTell()) now->motion = step;
    return;
  }
  now->change = reference->change = (step - *from.step) / from.since_s;
  reference->motion = 0.5 * (step + *from.step);
  now->motion = step + 0.5 * (step - *from.step);
}

std::optional<CameraMotion> ImageAligner::Align(const Reference& reference, const FrameFeatures& seen,
                                                const CameraMotion& start, const MotionPrior& prior,
                                                double exposure_s) const {
  const FrameFeatures& from = *reference.features;
  if (!HaveImages(from, seen)) return std::nullopt;
  const std::vector<Point> points = PointsOf(reference);
  if (static_cast<int>(points.size()) < kLeastPoints) return std::nullopt;
  const std::vector<cv::Mat>& levels = from.pyramid->Levels();
  const std::vector<cv::Mat> old = Coarse(levels), now = Coarse(seen.pyramid->Levels());
  CameraMotion found = start, before = reference.camera;
  double brightness = 0, explained = 0;
  for (const std::size_t l : {old.size() - 1, old.size() - 2, levels.size() - 1, Finest(levels)}) {
    if (l >= old.size()) continue;
    MoveOn(reference, &before, &found);
    MotionPrior held = prior;
    if (reference.step) {
      held.motion = found.motion;
      held.since_s = 0;
    }
    Level level(*this, old[l], now[l], old[0].size());
    level.Prepare(points, from.depth_grid.get(), before, found, exposure_s);
    if (!level.Fit(held, &found, &brightness, &explained)) return std::nullopt;
  }
  if (!(explained > kLeastExplained)) return std::nullopt;
  MoveOn(reference, &before, &found);
  return found;
}

std::array<double, ImageAligner::kExposures> ImageAligner::Misfits(const Reference& reference,
                                                                   const FrameFeatures& seen,
                                                                   const CameraMotion& camera) const {
  std::array<double, kExposures> misfits{};
  const FrameFeatures& from = *reference.features;
  if (!HaveImages(from, seen)) return misfits;
  const std::vector<Point> points = PointsOf(reference);
  const std::vector<cv::Mat>& levels = from.pyramid->Levels();
  const std::size_t l = Finest(levels);
  for (int i = 0; i < kExposures; ++i) {
    Level level(*this, levels[l], seen.pyramid->Levels()[l], levels[0].size());
    level.Prepare(points, from.depth_grid.get(), reference.camera, camera, Exposure(i));
    misfits[static_cast<std::size_t>(i)] = level.Misfit(camera);
    if (!(misfits[static_cast<std::size_t>(i)] > 0)) return {};
  }
  return misfits;
}

}  // namespace tutti
