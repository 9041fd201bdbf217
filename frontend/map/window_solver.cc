#include "frontend/map/window_solver.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/least_squares.h"
#include "frontend/map/reduced_system.h"

namespace tutti {
namespace {

using Matrix63d = Eigen::Matrix<double, 6, 3>;
using Matrix62d = Eigen::Matrix<double, 6, 2>;
using Matrix32d = Eigen::Matrix<double, 3, 2>;

constexpr double kBehindResidual = 1e3;  // of a point behind its camera; the Huber loss bounds its cost
constexpr double kStartRadius = 1e4;     // damping of 1e-4, relative to the diagonal
constexpr double kFreeGauge = 1e-8;      // damping that settles the scale, which one camera does not measure
constexpr double kCostTolerance = 1e-5;  // at 1e-4 the result depends on where the axes of the world point

// What the unknowns are at one moment.
struct Estimate {
  std::vector<Pose> poses;
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector2d lens;
};

class WindowSolver {
 public:
  WindowSolver(const PinholeCamera& camera, Window* window)
      : camera_(camera), window_(*window), reduced_(window->moving, SharedLandmarks(*window)) {
    now_ = {window_.T_camera_world, window_.points, window_.lens.value};
    const std::size_t cameras = static_cast<std::size_t>(window_.moving);
    pose_hessian_.resize(cameras);
    pose_gradient_.resize(cameras);
    pose_lens_.resize(cameras);
    point_hessian_.resize(now_.points.size());
    point_gradient_.resize(now_.points.size());
    point_lens_.resize(now_.points.size());
    pose_point_.resize(window_.observations.size());
    right_.resize(6 * window_.moving + 2);
  }

  WindowReport Solve(int max_iterations, const std::atomic<bool>* stop) {
    WindowReport report;
    double cost = report.initial_cost = report.final_cost = Cost(now_);
    internal::TrustRegion region{kStartRadius};
    bool fresh = false;
    while (report.iterations < max_iterations && std::isfinite(cost) && !(stop != nullptr && *stop)) {
      ++report.iterations;
      if (!fresh) Linearise();
      fresh = true;
      Estimate trial;
      double predicted = 0;
      const double next = Step(1 / region.radius, &trial, &predicted) ? Cost(trial) : INFINITY;
      if (!(next < cost)) {
        if (predicted >= 0 && predicted < kCostTolerance * cost && std::isfinite(next)) break;
        if (!region.Shrink()) break;
        continue;
      }
      region.Grow(predicted > 0 ? (cost - next) / predicted : 1.0);
      now_ = std::move(trial);
      fresh = false;
      const double gain = cost - next;
      cost = next;
      if (gain < kCostTolerance * cost) break;
    }
    report.final_cost = cost;
    report.usable = std::isfinite(cost);
    if (!report.usable) return report;
    window_.T_camera_world = now_.poses;
    window_.points = now_.points;
    window_.lens.value = now_.lens;
    if (lens_information_.allFinite()) window_.lens.information = lens_information_;
    return report;
  }

  // The lens after one Gauss-Newton step from where the window is.
  std::optional<LensError> Observe() {
    Linearise();
    Estimate trial;
    double predicted = 0;
    if (!Step(kFreeGauge, &trial, &predicted) || !lens_information_.allFinite() || !trial.lens.allFinite())
      return std::nullopt;
    return LensError{trial.lens, lens_information_};
  }

 private:
  // Pairs of moving cameras (a, b), b < a, that see a common point; of a small window nobody asks.
  static std::vector<std::pair<int, int>> SharedLandmarks(const Window& window) {
    std::vector<std::pair<int, int>> pairs;
    if (!ReducedSystem::IsSparse(window.moving)) return pairs;
    std::size_t distinct = 1 << 20;
    const auto tidy = [&pairs] {
      std::sort(pairs.begin(), pairs.end());
      pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    };
    for (std::size_t i = 0; i + 1 < window.first_observation.size(); ++i) {
      for (std::size_t a = window.first_observation[i]; a < window.first_observation[i + 1]; ++a) {
        for (std::size_t b = window.first_observation[i]; b < window.first_observation[i + 1]; ++b) {
          const int ca = window.observations[a].camera, cb = window.observations[b].camera;
          if (cb < ca && ca < window.moving) pairs.emplace_back(ca, cb);
        }
      }
      if (pairs.size() < distinct) continue;
      tidy();
      distinct = std::max(distinct, 2 * pairs.size());
    }
    tidy();
    return pairs;
  }

  using Reprojection = internal::Reprojection<3>;

  // Residual of an observation, in standard deviations. `p`: the point in the camera frame. False: behind.
  bool Residual(const Estimate& e, const WindowObservation& o, std::size_t point, Eigen::Vector3d* p,
                Eigen::Vector3d* r, Reprojection::PointJacobian* by_point) const {
    *p = e.poses[static_cast<std::size_t>(o.camera)] * e.points[point];
    Reprojection::Measurement measured = InSigmas(o.measured);
    measured.value.head<2>() = LensError::Correct(camera_, e.lens, o.measured.pixel);
    return Reprojection::Residual(camera_, *p, measured, kMinDepth, r, by_point);
  }

  double Cost(const Estimate& e) const {
    const Eigen::Vector2d lens = e.lens - window_.lens.value;
    double cost = 0.5 * lens.dot(window_.lens.information * lens);
    for (std::size_t i = 0; i < e.points.size(); ++i) {
      for (std::size_t n = window_.first_observation[i]; n < window_.first_observation[i + 1]; ++n) {
        const WindowObservation& o = window_.observations[n];
        Eigen::Vector3d p, r;
        const double squared =
            Residual(e, o, i, &p, &r, nullptr) ? r.squaredNorm() : kBehindResidual * kBehindResidual;
        cost += 0.5 * internal::HuberCost(squared, ChiSquareBound(o.measured));
      }
    }
    return cost;
  }

  void Linearise() {
    for (std::size_t c = 0; c < pose_hessian_.size(); ++c) {
      pose_hessian_[c].setZero();
      pose_gradient_[c].setZero();
      pose_lens_[c].setZero();
    }
    lens_hessian_ = window_.lens.information;
    lens_gradient_ = window_.lens.information * (now_.lens - window_.lens.value);
    rotations_.clear();
    for (const Pose& pose : now_.poses) rotations_.push_back(pose.rotation.toRotationMatrix());
    for (std::size_t i = 0; i < now_.points.size(); ++i) {
      point_hessian_[i].setZero();
      point_gradient_[i].setZero();
      point_lens_[i].setZero();
      for (std::size_t n = window_.first_observation[i]; n < window_.first_observation[i + 1]; ++n) {
        if (window_.observations[n].measured.inverse_depth_sigma > 0)
          AddObservation<3>(n, i);
        else
          AddObservation<2>(n, i);
      }
      if (i < window_.fixed_points) FixPoint(i);
    }
  }

  template <int N>
  void AddObservation(std::size_t n, std::size_t i) {
    const WindowObservation& o = window_.observations[n];
    Eigen::Vector3d p, full;
    Reprojection::PointJacobian by_point;
    pose_point_[n].setZero();
    if (!Residual(now_, o, i, &p, &full, &by_point)) return;
    const PointObservation& m = o.measured;
    const double root = std::sqrt(internal::HuberWeight(full.squaredNorm(), ChiSquareBound(m)));
    const Eigen::Matrix<double, N, 1> r = root * full.head<N>();
    const Eigen::Matrix<double, N, 3> d = root * by_point.topRows<N>();
    const std::size_t c = static_cast<std::size_t>(o.camera);
    const Eigen::Matrix<double, N, 3> jp = d * rotations_[c];
    Eigen::Matrix<double, N, 2> jl = Eigen::Matrix<double, N, 2>::Zero();
    jl.template topRows<2>() = LensError::Jacobian(camera_, m.pixel) * (-root / m.pixel_sigma);
    point_hessian_[i].noalias() += jp.transpose() * jp;
    point_gradient_[i].noalias() += jp.transpose() * r;
    point_lens_[i].noalias() += jp.transpose() * jl;
    lens_hessian_.noalias() += jl.transpose() * jl;
    lens_gradient_.noalias() += jl.transpose() * r;
    if (o.camera >= window_.moving) return;
    const Eigen::Matrix<double, N, 6> jc = internal::Reprojection<N>::ByPose(d, p);
    pose_hessian_[c].noalias() += jc.transpose() * jc;
    pose_gradient_[c].noalias() += jc.transpose() * r;
    pose_lens_[c].noalias() += jc.transpose() * jl;
    pose_point_[n].noalias() = jc.transpose() * jp;
  }

  // Nothing asks it to move, and no camera moves with it.
  void FixPoint(std::size_t i) {
    point_gradient_[i].setZero();
    point_lens_[i].setZero();
    for (std::size_t n = window_.first_observation[i]; n < window_.first_observation[i + 1]; ++n)
      pose_point_[n].setZero();
  }

  // Solves the damped normal equations; `predicted`: by how much the cost should fall.
  bool Step(double damping, Estimate* trial, double* predicted) {
    const Eigen::Index lens_at = 6 * window_.moving;
    reduced_.SetZero();
    for (int c = 0; c < window_.moving; ++c) {
      const std::size_t s = static_cast<std::size_t>(c);
      Matrix6d damped = pose_hessian_[s];
      damped.diagonal() += damping * pose_hessian_[s].diagonal();
      reduced_.SetDiagonal(c, damped);
      reduced_.AddLens(c, pose_lens_[s].transpose());
      right_.segment<6>(6 * c) = -pose_gradient_[s];
    }
    reduced_.SetLens(lens_hessian_);
    right_.segment<2>(lens_at) = -lens_gradient_;
    inverse_.resize(now_.points.size());
    for (std::size_t i = 0; i < now_.points.size(); ++i) EliminatePoint(i, damping);
    Eigen::VectorXd step;
    if (!reduced_.Solve(right_, &step, &lens_information_)) return false;
    Apply(step, damping, trial, predicted);
    return true;
  }

  void EliminatePoint(std::size_t i, double damping) {
    const Eigen::Index lens_at = 6 * window_.moving;
    Eigen::Matrix3d h = point_hessian_[i];
    h.diagonal() *= 1 + damping;
    h.diagonal().array() += 1e-9;  // a point that lies behind all its cameras stays
    inverse_[i] = h.inverse();
    const std::size_t begin = window_.first_observation[i], end = window_.first_observation[i + 1];
    const Eigen::Vector3d shift = inverse_[i] * point_gradient_[i];
    const Matrix32d lens = inverse_[i] * point_lens_[i];
    reduced_.AddLens(-point_lens_[i].transpose() * lens);
    right_.segment<2>(lens_at).noalias() += point_lens_[i].transpose() * shift;
    for (std::size_t a = begin; a < end; ++a) {
      const int ca = window_.observations[a].camera;
      if (ca >= window_.moving) continue;
      const Matrix63d wa = pose_point_[a] * inverse_[i];
      right_.segment<6>(6 * ca).noalias() += pose_point_[a] * shift;
      reduced_.AddLens(ca, -(pose_point_[a] * lens).transpose());
      for (std::size_t b = begin; b < end; ++b) {
        const int cb = window_.observations[b].camera;
        if (cb > ca) continue;  // the lower triangle; fixed cameras have the highest numbers
        reduced_.Subtract(ca, cb, wa * pose_point_[b].transpose());
      }
    }
  }

  void Apply(const Eigen::VectorXd& step, double damping, Estimate* trial, double* predicted) const {
    const Eigen::Vector2d lens = step.tail<2>();
    *trial = now_;
    trial->lens += lens;
    // 0.5 step' (damping D step - gradient), Madsen, Nielsen & Tingleff 2004, eq. 2.18.
    *predicted = -0.5 * lens.dot(lens_gradient_);
    for (int c = 0; c < window_.moving; ++c) {
      const std::size_t s = static_cast<std::size_t>(c);
      const Vector6d d = step.segment<6>(6 * c);
      trial->poses[s] = Pose(ExpSO3(d.tail<3>()), d.head<3>()) * trial->poses[s];
      *predicted += 0.5 * d.dot(damping * pose_hessian_[s].diagonal().cwiseProduct(d) - pose_gradient_[s]);
    }
    for (std::size_t i = 0; i < now_.points.size(); ++i) {
      Eigen::Vector3d right = -point_gradient_[i] - point_lens_[i] * lens;
      for (std::size_t n = window_.first_observation[i]; n < window_.first_observation[i + 1]; ++n) {
        const int c = window_.observations[n].camera;
        if (c < window_.moving) right.noalias() -= pose_point_[n].transpose() * step.segment<6>(6 * c);
      }
      const Eigen::Vector3d d = inverse_[i] * right;
      trial->points[i] += d;
      *predicted += 0.5 * d.dot(damping * point_hessian_[i].diagonal().cwiseProduct(d) - point_gradient_[i]);
    }
  }

  const PinholeCamera& camera_;
  Window& window_;
  Estimate now_;
  std::vector<Eigen::Matrix3d> rotations_;
  std::vector<Matrix6d> pose_hessian_;
  std::vector<Vector6d> pose_gradient_;
  std::vector<Matrix62d> pose_lens_;
  std::vector<Eigen::Matrix3d> point_hessian_, inverse_;
  std::vector<Eigen::Vector3d> point_gradient_;
  std::vector<Matrix32d> point_lens_;
  std::vector<Matrix63d> pose_point_;  // of each observation
  Eigen::Matrix2d lens_hessian_, lens_information_ = Eigen::Matrix2d::Constant(NAN);
  Eigen::Vector2d lens_gradient_;
  ReducedSystem reduced_;
  Eigen::VectorXd right_;
};

}  // namespace

WindowReport SolveWindow(const PinholeCamera& camera, int max_iterations, Window* window,
                         const std::atomic<bool>* stop) {
  return WindowSolver(camera, window).Solve(max_iterations, stop);
}

std::optional<LensError> ObserveLens(const PinholeCamera& camera, const Window& window) {
  Window free = window;
  free.moving = static_cast<int>(free.T_camera_world.size()) - 1;
  free.lens.information.setZero();
  if (free.moving < 1) return std::nullopt;
  return WindowSolver(camera, &free).Observe();
}

}  // namespace tutti
