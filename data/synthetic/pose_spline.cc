#include "data/synthetic/pose_spline.h"

#include <algorithm>

#include "tutti/core/error.h"

namespace tutti::synthetic {

PoseSpline::PoseSpline(const Trajectory& poses) {
  if (poses.size() < 3) throw InputError("a path needs three poses or more");
  begin_s_ = poses.front().stamp_s;
  for (const StampedPose& p : poses) {
    Knot knot;
    knot.time_s = p.stamp_s - begin_s_;
    knot.value << p.pose.translation, p.pose.rotation.coeffs();
    if (!knots_.empty()) {
      if (!(knot.time_s > knots_.back().time_s))
        throw InputError("a path's time stamps must grow from pose to pose");
      // q and -q are the same rotation: the one that lies nearer to the one before.
      if (knot.value.tail<4>().dot(knots_.back().value.tail<4>()) < 0) knot.value.tail<4>() *= -1;
    }
    knots_.push_back(knot);
  }
  FindCurvatures();
}

// Second derivatives at the knots, 0 at both ends: a tridiagonal system (Thomas' algorithm).
void PoseSpline::FindCurvatures() {
  const std::size_t n = knots_.size();
  std::vector<double> upper(n, 0);
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double before = knots_[i].time_s - knots_[i - 1].time_s;
    const double after = knots_[i + 1].time_s - knots_[i].time_s;
    const Vector7 bend = 6 * ((knots_[i + 1].value - knots_[i].value) / after -
                              (knots_[i].value - knots_[i - 1].value) / before);
    const double pivot = 2 * (before + after) - before * upper[i - 1];
    upper[i] = after / pivot;
    knots_[i].curvature = (bend - before * knots_[i - 1].curvature) / pivot;
  }
  for (std::size_t i = n - 1; i-- > 1;) knots_[i].curvature -= upper[i] * knots_[i + 1].curvature;
}

PoseSpline::Jet PoseSpline::JetAt(double time_s) const {
  if (time_s < 0 || time_s > Length())
    return {time_s < 0 ? knots_.front().value : knots_.back().value, Vector7::Zero(), Vector7::Zero()};
  const auto next = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, time_s,
                                     [](double t, const Knot& knot) { return t < knot.time_s; });
  const Knot &a = *(next - 1), &b = *next;
  const double h = b.time_s - a.time_s, v = (time_s - a.time_s) / h, u = 1 - v;
  Jet jet;
  jet.value =
      u * a.value + v * b.value + h * h / 6 * ((u * u * u - u) * a.curvature + (v * v * v - v) * b.curvature);
  jet.rate =
      (b.value - a.value) / h + h / 6 * ((1 - 3 * u * u) * a.curvature + (3 * v * v - 1) * b.curvature);
  jet.curvature = u * a.curvature + v * b.curvature;
  return jet;
}

Pose PoseSpline::At(double time_s) const {
  const Jet jet = JetAt(time_s);
  return Pose(Eigen::Quaterniond(Eigen::Vector4d(jet.value.tail<4>())).normalized(), jet.value.head<3>());
}

// w = 2 Im(conj(q) dq/dt); of dq/dt the part along q, which normalising takes away, has no imaginary part.
Eigen::Vector3d PoseSpline::AngularVelocity(double time_s) const {
  const Jet jet = JetAt(time_s);
  const Eigen::Quaterniond q(Eigen::Vector4d(jet.value.tail<4>()));
  const Eigen::Quaterniond rate(Eigen::Vector4d(jet.rate.tail<4>()));
  return 2 * (q.conjugate() * rate).vec() / q.squaredNorm();
}

Eigen::Vector3d PoseSpline::Acceleration(double time_s) const { return JetAt(time_s).curvature.head<3>(); }

}  // namespace tutti::synthetic
