#include "frontend/imu/imu_examination.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/dense_solvers.h"
#include "core/numbers.h"

namespace tutti {
namespace {

constexpr std::size_t kMostSteps = 1200, kFewSteps = 300;  // kept; where many offsets are tried
constexpr std::size_t kLeastSteps = 30;
constexpr double kLongestStep = 0.25;                     // [s]
constexpr double kLeastTurned = 20 * internal::kRadians;  // in all,
constexpr double kLeastRate = 2 * internal::kRadians;     // and per second, root mean square [rad/s]
constexpr double kWidestOffset = 0.3, kCoarse = 0.02, kFine = 0.002;  // that are tried [s]
constexpr double kMostOffset = 0.075;                                 // that is believed [s]
constexpr double kTurnsAgree = 0.9, kTurnsDiffer = 0.6;               // ImuReport::agreement
constexpr double kMountingOff = 5;                                    // from the calibration [deg]
constexpr double kKnownMounting = 1.5, kKnownOffset = 0.005;          // standard deviations [deg], [s]
constexpr double kMostBias = 0.35;                                    // [rad/s]
constexpr int kExamineEvery = 50;                                     // frames
constexpr double kHolds = 1;       // so long it carries the rotation alone [s]
constexpr int kOutlierRounds = 3;  // of leaving outliers out
constexpr double kOutlier = 4;     // of the median residual

}  // namespace

// The rotation and bias that explain the camera's turning best, at one offset.
struct ImuExamination::Fit {
  double offset_s = 0;
  std::size_t steps = 0;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  // R_camera_imu
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();
  double mean_square = std::numeric_limits<double>::infinity();  // of the residuals [rad^2]
  double signal = 0;                                      // mean square of the camera's turning [rad^2]
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  // of R
  bool mirrored = false;  // a reflection would explain it much better than any rotation

  double Agreement() const { return signal > 0 ? std::max(0.0, 1 - mean_square / signal) : 0; }
};

void ImuExamination::Add(const std::vector<ImuSample>& samples) {
  for (const ImuSample& sample : samples) track_.Add(sample);
  report_.samples += samples.size();
}

void ImuExamination::AddStep(double from_s, double to_s, const Eigen::Quaterniond& R_from_to) {
  if (track_.empty() || !(to_s > from_s && to_s - from_s < kLongestStep)) return;
  steps_.push_back({from_s, to_s, LogSO3(R_from_to)});
  if (steps_.size() > kMostSteps) steps_.pop_front();
  track_.ForgetBefore(steps_.front().from_s - 2 * kWidestOffset);
  if (++since_examined_ < kExamineEvery) return;
  since_examined_ = 0;
  Examine();
}

// Without what a constant bias adds: each side less its part along dt, by which the bias drops out.
std::vector<ImuExamination::Pair> ImuExamination::PairsAt(double offset_s, std::size_t most) const {
  std::vector<Pair> pairs;
  for (std::size_t i = steps_.size() - std::min(most, steps_.size()); i < steps_.size(); ++i) {
    const Step& step = steps_[i];
    const auto turned = track_.Turned(step.from_s - offset_s, step.to_s - offset_s);
    if (turned) pairs.push_back({step.to_s - step.from_s, step.turn, LogSO3(*turned)});
  }
  return pairs;
}

ImuExamination::Fit ImuExamination::FitAt(double offset_s, std::size_t most,
                                          const std::optional<Eigen::Quaterniond>& mounting) const {
  std::vector<Pair> pairs = PairsAt(offset_s, most);
  Fit fit;
  fit.offset_s = offset_s;
  std::vector<double> squares;
  for (int round = 0; round < kOutlierRounds && pairs.size() >= kLeastSteps; ++round) {
    if (round > 0) {  // frames whose pose was wrong
      const double bound = kOutlier * kOutlier * internal::Median(squares);
      std::size_t kept = 0;
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        if (squares[i] <= bound) pairs[kept++] = pairs[i];
      }
      if (kept == pairs.size() || kept < kLeastSteps) break;
      pairs.resize(kept);
    }
    double dt2 = 0;
    Eigen::Vector3d camera_rate = Eigen::Vector3d::Zero(), gyro_rate = Eigen::Vector3d::Zero();
    for (const Pair& p : pairs) {
      dt2 += p.dt * p.dt;
      camera_rate += p.dt * p.camera;
      gyro_rate += p.dt * p.gyro;
    }
    camera_rate /= dt2, gyro_rate /= dt2;
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    double signal = 0, gyro_signal = 0;
    for (const Pair& p : pairs) {
      const Eigen::Vector3d c = p.camera - p.dt * camera_rate, g = p.gyro - p.dt * gyro_rate;
      sum += c * g.transpose();
      signal += c.squaredNorm();
      gyro_signal += g.squaredNorm();
    }
    if (mounting) {
      fit.R = mounting->toRotationMatrix();
    } else {
      const internal::Svd3 svd = internal::SingularValues(sum);
      const double side = (svd.u * svd.v.transpose()).determinant() < 0 ? -1 : 1;
      fit.R = svd.u * Eigen::Vector3d(1, 1, side).asDiagonal() * svd.v.transpose();
      const double all = signal + gyro_signal, trace = svd.values[0] + svd.values[1];
      fit.mirrored = side < 0 &&
                     all - 2 * (trace - svd.values[2]) > 4 * (all - 2 * (trace + svd.values[2])) &&
                     svd.values[2] > 0.002 * signal;
    }
    fit.bias = gyro_rate - fit.R.transpose() * camera_rate;
    squares.clear();
    fit.information.setZero();
    double residuals = 0;
    for (const Pair& p : pairs) {
      const Eigen::Vector3d turned = fit.R * (p.gyro - p.dt * fit.bias);
      squares.push_back((p.camera - turned).squaredNorm());
      residuals += squares.back();
      const Eigen::Matrix3d cross = Skew(turned - p.dt * fit.R * (gyro_rate - fit.bias));
      fit.information += cross.transpose() * cross;
    }
    fit.steps = pairs.size();
    fit.mean_square = residuals / static_cast<double>(pairs.size());
    fit.signal = signal / static_cast<double>(pairs.size());
  }
  if (fit.steps > 0) fit.information *= 3 / std::max(fit.mean_square, 1e-14);
  return fit;
}

ImuExamination::Fit ImuExamination::BestOffset(double around_s, double reach_s, double step_s,
                                               std::size_t most) const {
  Fit best;
  const int reach = static_cast<int>(std::lround(reach_s / step_s));
  for (int k = -reach; k <= reach; ++k) {
    const Fit fit = FitAt(around_s + k * step_s, most, std::nullopt);
    if (fit.steps > 0 && fit.mean_square < best.mean_square) best = fit;
  }
  return best;
}

bool ImuExamination::TurnsEnough() const {
  double angle = 0, square = 0, time = 0;
  for (const Step& step : steps_) {
    angle += step.turn.norm();
    square += step.turn.squaredNorm() / (step.to_s - step.from_s);
    time += step.to_s - step.from_s;
  }
  return steps_.size() >= kLeastSteps && angle >= kLeastTurned && square >= kLeastRate * kLeastRate * time;
}

void ImuExamination::Examine() {
  report_.steps = steps_.size();
  report_.turned_deg = 0;
  for (const Step& step : steps_) report_.turned_deg += step.turn.norm() * internal::kDegrees;
  if (!TurnsEnough()) return;
  Fit best;
  if (report_.trusted) {
    best = BestOffset(report_.time_offset_s, 2 * kFine, kFine, kFewSteps);
  } else {
    best = BestOffset(known_.time_offset_s, kWidestOffset, kCoarse, kFewSteps);
    if (best.steps > 0) best = BestOffset(best.offset_s, kCoarse, 2 * kFine, kFewSteps);
  }
  if (best.steps == 0) return;
  // The parabola through three offsets, on all steps.
  const double h = 2 * kFine;
  const Fit before = FitAt(best.offset_s - h, kMostSteps, std::nullopt);
  const Fit at = FitAt(best.offset_s, kMostSteps, std::nullopt);
  const Fit after = FitAt(best.offset_s + h, kMostSteps, std::nullopt);
  const double bend = before.mean_square - 2 * at.mean_square + after.mean_square;
  double offset = best.offset_s;
  if (bend > 0 && before.steps > 0 && after.steps > 0) {
    offset += std::clamp(0.5 * h * (before.mean_square - after.mean_square) / bend, -h, h);
    const double curvature = bend / (h * h);
    report_.time_offset_sigma_s =
        std::sqrt(2 * at.mean_square / (curvature * static_cast<double>(std::max<std::size_t>(1, at.steps))));
  }
  Judge(FitAt(offset, kMostSteps, std::nullopt));
}

// What the best fit says of the IMU, and against it.
void ImuExamination::Judge(const Fit& fit) {
  if (fit.steps == 0) return;
  report_.findings.clear();
  report_.agreement = fit.Agreement();
  report_.residual_deg = std::sqrt(fit.mean_square) * internal::kDegrees;
  report_.time_offset_s = fit.offset_s;
  report_.gyro_bias = fit.bias;
  CheckUnit();
  if (report_.findings.empty() && fit.mirrored)
    report_.findings.push_back(
        {"its axes are left-handed: only mirrored does it turn as the images do",
         "two axes are swapped, or one has the wrong sign; look at the driver's order of x, y and z"});
  if (report_.findings.empty() && fit.Agreement() < kTurnsDiffer)
    report_.findings.push_back(
        {FormattedText(
             "it does not turn as the images do: at no mounting and no time offset does it explain more than "
             "%.0f %% of their turning",
             100 * fit.Agreement()),
         "give the measurements of this recording; if they are, look at the units and the axes"});
  if (report_.findings.empty() && std::abs(fit.offset_s - known_.time_offset_s) > kMostOffset)
    report_.findings.push_back(
        {FormattedText("its clock is off by %.0f ms from the images'",
                       1000 * (fit.offset_s - known_.time_offset_s)),
         FormattedText("give imu.time_offset_s: %.3f, or stamp both by one clock", fit.offset_s)});
  if (report_.findings.empty() && fit.bias.norm() > kMostBias)
    report_.findings.push_back(
        {FormattedText("its gyroscope has a bias of %.2f rad/s", fit.bias.norm()), "calibrate it at rest"});
  CheckMounting(fit);
  const bool clear = report_.findings.empty();
  const bool known = report_.R_camera_imu && report_.time_offset_sigma_s < kKnownOffset;
  report_.trusted = clear && known && fit.Agreement() >= kTurnsAgree;
  report_.moments.push_back({steps_.back().to_s, report_.residual_deg, fit.offset_s, fit.bias});
}

// The mounting is measured where the camera turned about two axes; else the calibration is believed.
void ImuExamination::CheckMounting(const Fit& fit) {
  report_.R_camera_imu.reset();
  const auto covariance = internal::InverseInformation(fit.information);
  if (covariance) {
    const internal::Eigenpairs worst = internal::SymmetricEigen(*covariance);
    report_.mounting_sigma_deg = std::sqrt(std::max(0.0, worst.values.maxCoeff())) * internal::kDegrees;
    if (report_.mounting_sigma_deg < kKnownMounting) report_.R_camera_imu = Eigen::Quaterniond(fit.R);
  }
  if (!known_.T_camera_imu) return;
  const Eigen::Quaterniond given = known_.T_camera_imu->rotation;
  if (!report_.R_camera_imu) {
    report_.R_camera_imu = given;
    return;
  }
  const double off = given.angularDistance(*report_.R_camera_imu) * internal::kDegrees;
  if (!report_.findings.empty() || off < std::max(kMountingOff, 4 * report_.mounting_sigma_deg)) return;
  const Eigen::Quaterniond q = *report_.R_camera_imu;
  report_.findings.push_back(
      {FormattedText("it is mounted otherwise than its calibration says: %.0f deg off", off),
       FormattedText(
           "look at the order and signs of its axes, or correct T_camera_imu; measured: quaternion x %.4f y "
           "%.4f z %.4f w %.4f",
           q.x(), q.y(), q.z(), q.w())});
}

// Numbers in deg/s turn 57 times as much, by the sum of the angles, which needs no mounting.
void ImuExamination::CheckUnit() {
  std::vector<double> ratios;
  for (const Step& step : steps_) {
    const auto rate = track_.MeanRate(step.from_s - known_.time_offset_s, step.to_s - known_.time_offset_s);
    const double turned = step.turn.norm();
    if (rate && turned > kLeastRate * (step.to_s - step.from_s))
      ratios.push_back(*rate * (step.to_s - step.from_s) / turned);
  }
  if (ratios.size() < kLeastSteps) return;
  const double ratio = internal::Median(ratios);
  if (ratio > 20 && ratio < 200)
    report_.findings.push_back(
        {FormattedText("its gyroscope turns %.0f times as much as the images: it is in deg/s", ratio),
         "multiply the angular velocities by 0.0174533: they must be in rad/s"});
  else if (ratio < 0.05)
    report_.findings.push_back({"its gyroscope does not turn where the images do",
                                "look whether it is switched on, and at its units (rad/s)"});
}

std::optional<Eigen::Quaterniond> ImuExamination::CameraTurn(double from_s, double to_s) const {
  if (!report_.trusted || !report_.R_camera_imu || !(to_s - from_s <= kHolds)) return std::nullopt;
  const double offset = report_.time_offset_s;
  const auto turned = track_.Turned(from_s - offset, to_s - offset, report_.gyro_bias);
  if (!turned) return std::nullopt;
  const Eigen::Quaterniond R = *report_.R_camera_imu;
  return (R * turned->conjugate() * R.conjugate()).normalized();
}

std::vector<ImuTurn> ImuExamination::Turns() const {
  std::vector<ImuTurn> turns;
  if (!report_.R_camera_imu) return turns;
  for (const Step& step : steps_) {
    const double offset = report_.time_offset_s, dt = step.to_s - step.from_s;
    const auto turned = track_.Turned(step.from_s - offset, step.to_s - offset, report_.gyro_bias);
    if (!turned) continue;
    const Eigen::Vector3d gyro = *report_.R_camera_imu * LogSO3(*turned);
    turns.push_back({step.to_s, step.turn.norm() / dt * internal::kDegrees,
                     gyro.norm() / dt * internal::kDegrees, (step.turn - gyro).norm() * internal::kDegrees});
  }
  return turns;
}

std::optional<Eigen::Vector3d> ImuExamination::VelocityGained(double from_s, double to_s) const {
  if (!report_.trusted) return std::nullopt;
  const double offset = report_.time_offset_s;
  return track_.VelocityGained(from_s - offset, to_s - offset, report_.gyro_bias);
}

bool ImuExamination::IsPossible() const {
  const auto finite = [](const Step& step) {
    return std::isfinite(step.from_s) && step.to_s > step.from_s && step.turn.allFinite();
  };
  const ImuReport& r = report_;
  const bool mounting = !r.R_camera_imu || r.R_camera_imu->coeffs().allFinite();
  return track_.IsPossible() && std::all_of(steps_.begin(), steps_.end(), finite) && mounting &&
         steps_.size() <= kMostSteps && std::isfinite(r.time_offset_s) && r.gyro_bias.allFinite();
}

}  // namespace tutti
