// Can these be measurements of an IMU? What they show by themselves (sample_check.cc); and whether they turn
// as the camera does, how the IMU is mounted, and by how much its clock is off.
#pragma once

#include <Eigen/Geometry>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "frontend/imu/gyro_track.h"
#include "tutti/core/imu.h"
#include "tutti/frontend/imu.h"

#pragma GCC visibility push(default)  // of the commands, too
namespace tutti {

template <class Archive>
void State(Archive& archive, ImuFinding& finding) {
  archive(finding.measured, finding.advice);
}
template <class Archive>
void State(Archive& archive, ImuMoment& m) {
  archive(m.stamp_s, m.residual_deg, m.time_offset_s, m.gyro_bias);
}
template <class Archive>
void State(Archive& archive, ImuReport& r) {
  archive(r.samples, r.rate_hz, r.duration_s, r.missing_share, r.longest_gap_s, r.acceleration_mps2, r.steps,
          r.turned_deg, r.agreement, r.residual_deg, r.R_camera_imu, r.mounting_sigma_deg, r.time_offset_s,
          r.time_offset_sigma_s, r.gyro_bias, r.moments, r.trusted, r.findings);
}

/// Compares the gyroscope with the turning of a camera, frame by frame: the rotation R_camera_imu, the bias
/// and the time offset that explain it best. With rotation vectors c of the camera and g of the gyroscope
/// over an interval dt,
///   c = R (g - bias dt),
/// of which the bias follows linearly and R from the singular values of sum c g^T (Wahba's problem; Markley:
/// "Attitude determination using vector observations and the singular value decomposition", 1988), for each
/// offset that is tried. Keeps the newest minute. Value type.
class ImuExamination {
 public:
  /// What is known of the IMU is believed unless the camera contradicts it.
  explicit ImuExamination(const ImuCalibration& known = {}) : known_(known) {}

  /// Measurements, in order of time.
  void Add(const std::vector<ImuSample>& samples);
  /// How the camera turned from one frame to the next: R_from_to.
  void AddStep(double from_s, double to_s, const Eigen::Quaterniond& R_from_to);
  /// Brings the report up to date.
  void Examine();

  /// Of what was compared so far; CheckSamples has the rest.
  const ImuReport& report() const { return report_; }
  /// How the two turned, for each step that is kept; none before the mounting is known.
  std::vector<ImuTurn> Turns() const;
  /// R_to_from of the camera between two times, if the IMU is trusted and has measured all the while.
  std::optional<Eigen::Quaterniond> CameraTurn(double from_s, double to_s) const;
  /// What the IMU gained of velocity between two times, with gravity, in its axes at the first one [m/s]; if
  /// it is trusted and has measured all the while.
  std::optional<Eigen::Vector3d> VelocityGained(double from_s, double to_s) const;
  /// Measurements go on at least until then, by the camera's clock.
  bool ReachesTo(double stamp_s) const {
    return !empty() && track_.end_s() > stamp_s - report_.time_offset_s;
  }
  bool empty() const { return track_.empty(); }
  /// False for numbers from a damaged file.
  bool IsPossible() const;

  template <class Archive>
  void State(Archive& archive) {
    archive(track_, steps_, since_examined_, report_);
  }

 private:
  // The camera's turning from one frame to the next.
  struct Step {
    double from_s = 0, to_s = 0;
    Eigen::Vector3d turn = Eigen::Vector3d::Zero();  // rotation vector of R_from_to
    template <class Archive>
    void State(Archive& archive) {
      archive(from_s, to_s, turn);
    }
  };
  struct Pair {
    double dt;
    Eigen::Vector3d camera, gyro;
  };
  struct Fit;

  std::vector<Pair> PairsAt(double offset_s, std::size_t most) const;
  Fit FitAt(double offset_s, std::size_t most, const std::optional<Eigen::Quaterniond>& mounting) const;
  Fit BestOffset(double around_s, double reach_s, double step_s, std::size_t most) const;
  bool TurnsEnough() const;
  void Judge(const Fit& fit);
  void CheckMounting(const Fit& fit);
  void CheckUnit();

  ImuCalibration known_;
  GyroTrack track_;
  std::deque<Step> steps_;
  int since_examined_ = 0;
  ImuReport report_;
};

/// Rate, gaps, order, stuck values, the unit of the accelerations, and noise at rest; of a whole recording.
/// Findings have a remedy each.
ImuReport CheckSamples(const std::vector<ImuSample>& samples);

/// As snprintf.
std::string FormattedText(const char* format, ...) __attribute__((format(printf, 1, 2)));

/// Adds a finding if measurements cover less than half of the time between two stamps of the camera.
void CheckOverlap(const std::vector<ImuSample>& samples, double first_frame_s, double last_frame_s,
                  ImuReport* report);

}  // namespace tutti
#pragma GCC visibility pop
