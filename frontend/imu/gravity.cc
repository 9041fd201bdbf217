#include "frontend/imu/gravity.h"

#include <algorithm>
#include <cmath>

#include "core/dense_solvers.h"
#include "core/numbers.h"

namespace tutti {
namespace {

constexpr double kWindow_s = 1;
constexpr double kLongestGain_s = 0.5;  // between frames
constexpr std::size_t kLeastWindows = 3;
constexpr int kFree = 4, kWeightings = 12;            // rounds without gravity's length, all
constexpr double kBiasSigma = 0.3;                    // of an accelerometer, before anything is known [m/s^2]
constexpr double kLeastSigma = 0.02;                  // of a window [m/s^2]
constexpr double kStandard = 9.807, kOnEarth = 0.02;  // gravity's length, and its standard deviation [m/s^2]
constexpr double kMostOff = 0.5;                      // of the length as measured [m/s^2]
constexpr double kMostSigma_deg = 1;
// One camera: what it accelerated by is known from the scale to so much of it, or was hardly anything.
constexpr double kKnownScale = 0.1, kStill = 0.05;  // [1], [m/s^2]
constexpr std::size_t kMostWaiting = 2000;

using Unknowns = Eigen::Matrix<double, 7, 1>;  // g u, b, s
using Normal = Eigen::Matrix<double, 7, 7>;

}  // namespace

struct Gravity::Window {
  Eigen::Vector3d felt = Eigen::Vector3d::Zero();      // mean of R a [m/s^2]
  Eigen::Vector3d moved = Eigen::Vector3d::Zero();     // mean acceleration that the poses say
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();  // mean R_world_imu
  Frame middle;

  Eigen::Vector3d GravityBy(const Unknowns& x) const {
    return felt - rotation * x.segment<3>(3) - x[6] * moved;
  }
  Eigen::Vector3d MisfitOf(const Unknowns& x) const { return GravityBy(x) - x.head<3>(); }
};

void Gravity::Take(const ImuExamination& imu) {
  while (waiting_.size() > kMostWaiting) waiting_.pop_front();
  if (!imu.report().trusted) return;
  while (waiting_.size() > 1 && imu.ReachesTo(waiting_[1].stamp_s)) {
    const Frame from = waiting_[0], to = waiting_[1];
    waiting_.pop_front();
    if (!(to.stamp_s - from.stamp_s <= kLongestGain_s)) continue;
    if (const auto gained = imu.VelocityGained(from.stamp_s, to.stamp_s))
      steps_.push_back({from, to, *gained});
  }
}

std::vector<Gravity::Window> Gravity::WindowsOf(const std::map<std::int64_t, Pose>& T_world_camera,
                                                const Eigen::Quaterniond& R_camera_imu) const {
  const auto pose = [&](std::int64_t number) -> const Pose* {
    const auto at = T_world_camera.find(number);
    return at == T_world_camera.end() ? nullptr : &at->second;
  };
  // Of the frame between two steps, by the poses at their other ends.
  const auto velocity = [&](std::size_t step) -> std::optional<Eigen::Vector3d> {
    const Step &before = steps_[step], &after = steps_[step + 1];
    const Pose *from = pose(before.from.number), *to = pose(after.to.number);
    if (before.to.number != after.from.number || !from || !to || !pose(after.from.number))
      return std::nullopt;
    return (to->translation - from->translation) / (after.to.stamp_s - before.from.stamp_s);
  };
  std::vector<Window> windows;
  for (std::size_t first = 0; first + 2 < steps_.size();) {
    const std::size_t begin = first++;  // at whose end the window begins
    const auto v_from = velocity(begin);
    if (!v_from) continue;
    // A velocity is a mean over two steps: what they gained counts from none of it to all, and back at the
    // end.
    Window window;
    double seconds = 0, weights = 0;
    const auto add = [&](std::size_t k, double weight) {
      const double dt = steps_[k].to.stamp_s - steps_[k].from.stamp_s;
      const Eigen::Matrix3d R = (pose(steps_[k].from.number)->rotation * R_camera_imu).toRotationMatrix();
      window.felt += weight * (R * steps_[k].gained);
      window.rotation += weight * dt * R;
      weights += weight * dt;
    };
    std::size_t k = begin + 1;
    for (; k + 1 < steps_.size() && seconds < kWindow_s; ++k) {
      if (!pose(steps_[k].from.number) || steps_[k - 1].to.number != steps_[k].from.number) break;
      add(k, k == begin + 1 ? 0.75 : 1);
      seconds += steps_[k].to.stamp_s - steps_[k].from.stamp_s;
    }
    const auto v_to = seconds < kWindow_s || k < begin + 3 ? std::nullopt : velocity(k - 1);
    if (!v_to) continue;
    add(begin, 0.25);
    add(k - 1, -0.25);
    add(k, 0.25);
    window.felt /= weights;
    window.rotation /= weights;
    window.moved = (*v_to - *v_from) / seconds;
    window.middle = steps_[(begin + 1 + k) / 2].from;
    windows.push_back(window);
    first = k - 1;
  }
  return windows;
}

void Gravity::Find(const std::map<std::int64_t, Pose>& T_world_camera, bool metric, ImuReport* report) const {
  if (!report->trusted || !report->R_camera_imu) return;
  const std::vector<Window> windows = WindowsOf(T_world_camera, *report->R_camera_imu);
  if (windows.size() < kLeastWindows) return;
  Unknowns x = Unknowns::Zero();
  Normal normal;
  double sigma = kBiasSigma, length = 0;  // of gravity, as it is measured
  for (int round = 0; round < kWeightings; ++round) {
    normal.setZero();
    Unknowns right = Unknowns::Zero();
    normal.diagonal().segment<3>(3).setConstant(1 / (kBiasSigma * kBiasSigma));
    normal(6, 6) = metric ? 1e6 : 1e-6;  // the scale of a metric map is 1
    right[6] = metric ? 1e6 : 0;
    if (round >= kFree) {
      const Eigen::Vector3d up = x.head<3>().normalized();
      normal.topLeftCorner<3, 3>() += up * up.transpose() / (kOnEarth * kOnEarth);
      right.head<3>() += kStandard * up / (kOnEarth * kOnEarth);
    }
    std::vector<double> misfits;
    misfits.reserve(windows.size());
    for (const Window& w : windows) {
      Eigen::Matrix<double, 3, 7> by;
      by << Eigen::Matrix3d::Identity(), w.rotation, w.moved;
      const double misfit = w.MisfitOf(x).norm();
      const double weight = round == 0 ? 1 : 1 / (1 + misfit * misfit / (4 * sigma * sigma));
      normal += weight / (sigma * sigma) * by.transpose() * by;
      right += weight / (sigma * sigma) * by.transpose() * w.felt;
    }
    x = internal::SolveLdlt<7>(normal, right);
    for (const Window& w : windows) misfits.push_back(w.MisfitOf(x).norm());
    sigma = std::max(kLeastSigma, internal::Median(misfits) / 1.54);  // of one axis, were they normal
    if (round < kFree) length = x.head<3>().norm();
  }
  const auto covariance = internal::InverseInformation(normal);
  if (!covariance || !x.allFinite() || !(std::abs(length - kStandard) < kMostOff)) return;
  const double scale_sigma = std::sqrt(std::max(0.0, Eigen::MatrixXd(*covariance)(6, 6)));
  if (!metric && !(scale_sigma < kKnownScale * x[6]) && !(sigma < kStill)) return;
  // Across up, the worst axis.
  const Eigen::Vector3d up = x.head<3>().normalized();
  const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - up * up.transpose();
  const Eigen::Matrix3d spread = across * Eigen::MatrixXd(*covariance).topLeftCorner<3, 3>() * across;
  const double sum = spread.trace(), squares = (spread * spread).trace();
  const double variance = 0.5 * (sum + std::sqrt(std::max(0.0, 2 * squares - sum * sum)));
  const double sigma_deg = std::sqrt(variance) / kStandard * internal::kDegrees;
  if (!(sigma_deg < kMostSigma_deg)) return;
  report->up = up;
  report->up_sigma_deg = sigma_deg;
  report->gravity_mps2 = length;
  report->acceleration_bias = x.segment<3>(3);
  for (const Window& w : windows)
    report->tilts.push_back({w.middle.number, w.middle.stamp_s, w.GravityBy(x).normalized()});
  if (metric || !(x[6] > 0)) return;
  report->metres = x[6];
  report->metres_sigma = scale_sigma / x[6];
}

bool Gravity::IsPossible() const {
  for (const Step& step : steps_) {
    if (!step.gained.allFinite() || !(step.to.stamp_s > step.from.stamp_s)) return false;
  }
  return waiting_.size() <= kMostWaiting + 1;
}

}  // namespace tutti
