// The trajectory of another odometry, and the images that were taken along it.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "apps/slam/odometry_jumps.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// Where the trajectory and the stamps of the images come from.
struct GivenOdometryFiles {
  std::filesystem::path trajectory;            ///< TUM, KITTI or EuRoC
  std::string format = "auto";                 ///< or tum, kitti, euroc
  std::optional<std::filesystem::path> depth;  ///< folder of depth images for a plain folder of images
  std::optional<std::filesystem::path> times;  ///< one stamp a line: of the images, of KITTI's poses, or both
  std::optional<std::filesystem::path> sigmas;  ///< how uncertain its motions are (ReadMotionSigmas)
};

/// Poses of a body for the images of a data set. Immutable.
class GivenOdometry {
 public:
  /// Throws InputError with file and line for a trajectory that can't be used.
  GivenOdometry(const GivenOdometryFiles& files, const std::filesystem::path& images,
                const DatasetOptions& options);

  /// The data set; images that have no time stamps of their own (a folder of images, a video) get those of
  /// --times, else of times.txt in the folder or the one above, else of their names, else of the poses by
  /// order. Throws InputError if none of this works, or if not one image has a pose.
  std::unique_ptr<Dataset> Open() const;
  /// T_odom_body at that time: interpolated between poses at most 1 s apart, else of a pose within 0.02 s.
  /// Outliers (FindJumps) are replaced.
  std::optional<Pose> At(double stamp_s) const;
  /// How uncertain the motion from the one time to the other is, as far as the files say: in the trajectory's
  /// own columns or a file beside it. Within a motion the variance grows evenly.
  std::optional<MotionSigma> SigmaBetween(double from_s, double to_s) const;
  /// The poses that the file has, outliers among them.
  const Trajectory& trajectory() const { return as_given_; }
  /// Its jumps, in order of time.
  const std::vector<OdometryJump>& jumps() const { return jumps_; }
  /// What was found and decided.
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  std::vector<double> ImageStamps(const Dataset& all, bool numbered);
  void StampByOrder(bool numbered, const Dataset& all);
  Eigen::Vector2d Variance(double stamp_s) const;

  GivenOdometryFiles files_;
  std::filesystem::path images_;
  DatasetOptions options_;
  Trajectory as_given_, trajectory_;  // trajectory_: without outliers
  std::vector<OdometryJump> jumps_;
  std::vector<Eigen::Vector2d> variances_;  // of translation and rotation, from the first pose to each
  bool has_stamps_ = true;                  // false: numbers of lines
  std::vector<double> stamps_;              // of all images; empty: the data set has its own
  std::vector<std::string> notes_;
};

}  // namespace tutti
