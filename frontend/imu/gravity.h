// Which way is up, by the accelerations of an IMU and the motion that the images show.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "frontend/imu/imu_examination.h"
#include "tutti/core/pose.h"

namespace tutti {

/// An accelerometer measures what moves it, and what holds it up. Over a window of T seconds,
///   sum R_i a_i = g T u + (v_to - v_from) s + T R b
/// with R_i the camera's rotations, a_i what each step from frame to frame gained of velocity
/// (ImuExamination::VelocityGained), g u gravity's counterpart, v the velocities that the poses say, s the
/// scale of one camera's map, and b the accelerometer's bias. It is linear in g u, b and s: least squares
/// over all windows, with weights that fall with the misfit (Cauchy), at last with g known. Value type.
class Gravity {
 public:
  /// A frame came, at this time by the camera's clock.
  void AddFrame(std::int64_t number, double stamp_s) { waiting_.push_back({number, stamp_s}); }
  /// What was measured up to the frames that came, as far as the IMU is trusted and its measurements are
  /// there.
  void Take(const ImuExamination& imu);
  /// Adds up, length, bias, each window's tilt and the unit of one camera's map to the report if the windows
  /// tell: by the poses T_world_camera that the frames have now. `metric`: in metres.
  void Find(const std::map<std::int64_t, Pose>& T_world_camera, bool metric, ImuReport* report) const;
  /// False for numbers from a damaged file.
  bool IsPossible() const;

  template <class Archive>
  void State(Archive& archive) {
    archive(waiting_, steps_);
  }

 private:
  struct Frame {
    std::int64_t number = 0;
    double stamp_s = 0;
    template <class Archive>
    void State(Archive& archive) {
      archive(number, stamp_s);
    }
  };
  // From one frame to the next one.
  struct Step {
    Frame from, to;
    Eigen::Vector3d gained = Eigen::Vector3d::Zero();  // in the IMU's axes at its beginning [m/s]
    template <class Archive>
    void State(Archive& archive) {
      archive(from, to, gained);
    }
  };
  struct Window;
  std::vector<Window> WindowsOf(const std::map<std::int64_t, Pose>& T_world_camera,
                                const Eigen::Quaterniond& R_camera_imu) const;

  std::deque<Frame> waiting_;
  std::vector<Step> steps_;
};

}  // namespace tutti
