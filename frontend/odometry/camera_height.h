// One camera on a vehicle: how high it is above the ground, in the map's unit. The height stays; where the
// map says otherwise, its scale has drifted.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "frontend/features/features.h"
#include "frontend/geometry/ground_plane.h"
#include "frontend/odometry/ground_ahead.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

/// Value type. Trusts nothing of it until the ground has been seen again and again at one height: a camera
/// in a hand, on a drone, or before anything but a ground gives no drift.
class CameraHeight {
 public:
  /// The next frame, which has its image. `depth`: what is in view, typically [map units]; `interval_s`:
  /// since the frame at T_last_world [s].
  void See(const PinholeCamera& camera, const std::shared_ptr<const FrameFeatures>& features,
           const Pose& T_camera_world, const Pose& T_last_world, double depth, double interval_s);
  /// Nothing that was known holds any more: another piece of the map.
  void Forget();
  /// Logarithm of how much larger the map is here than where the height was first seen; none: not known, or
  /// not enough to say.
  std::optional<double> Drift() const;
  /// The map around the camera was made larger by this factor, to take a drift out.
  void Correct(double scale);
  /// It was, since a loop says so: it is right there.
  void Rescale(double scale);

  /// What is known, and what was corrected so far; none: nothing is.
  std::optional<HeightFound> Found() const;
  /// False: not what a file can have kept of one.
  bool IsPossible() const;

  template <class Archive>
  void State(Archive& archive) {
    archive(first_, T_last_first_, age_, waited_, ahead_, plane_, reference_, drift_, covariance_, seen_,
            share_, spread_, bias_, failures_, others_, changes_, biased_, corrections_, corrected_, speeds_,
            known_speed_);
  }

 private:
  void Search(const PinholeCamera& camera, const FrameFeatures& now);
  void Measure(const PinholeCamera& camera, const FrameFeatures& now);
  void Take(const GroundAhead::Height& height);
  void Update(double misfit, double way);
  double Misfit(double log_height) const { return log_height - reference_ - drift_; }
  void Scale(double scale);
  void SeeSpeed(double step, double interval_s);
  bool ScaleChanged(double by) const;
  void BeginAnew();
  void Learn(double log_height);

  std::shared_ptr<const FrameFeatures> first_;  // the frame that the next ones are compared with
  Pose T_last_first_;
  int age_ = 0, waited_ = 0;                         // frames since first_, and since the last search
  GroundAhead ahead_;                                // what Measure has found
  Eigen::Vector3d plane_ = Eigen::Vector3d::Zero();  // GroundPlane::normal_by_height; 0: not known
  double reference_ = 0, drift_ = 0;                 // logarithms: of the height at first, and of the drift
  Eigen::Matrix2d covariance_ = Eigen::Matrix2d::Zero();  // of both
  int seen_ = 0;                                          // measurements since the search
  double share_ = 0, spread_ = 0, bias_ = 0;  // of late: that agreed, their squared misfit, their misfit
  int biased_ = 0;                            // measurements in a row that run away
  int changes_ = 0;                           // times that it was found to rise or sink, at most 8
  int corrections_ = 0;                       // by Correct, ever
  double corrected_ = 0;                      // the logarithm of all of them
  // Logarithms of the speed [map units per second]: the newest ones, and for long, without the drift.
  std::vector<double> speeds_;
  double known_speed_ = 0;
  int failures_ = 0, others_ = 0;  // in a row: without the ground; searches that found another
};

}  // namespace tutti
