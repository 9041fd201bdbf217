// Learns what the calibration left over of the lens, from the windows of the local bundle adjustment, and
// takes it out of the features.
//
// A radial distortion of one percent that rectification left over bends forward motion into a drift of the
// scale: landmarks move outwards in the image as the camera comes nearer, and look nearer than they are by
// ever more. That drift fits into every window of keyframes; but landmarks at all radii must agree, and that
// tells the distortion.
#pragma once

#include <memory>
#include <vector>

#include "frontend/features/features.h"
#include "frontend/geometry/lens_error.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {

template <class Archive>
void State(Archive& archive, LensFound::Step& step) {
  archive(step.frame_index, step.k1, step.k2, step.k1_sigma, step.k2_sigma);
}

/// Value type: copies with the odometry. For mono alone: with depth the scale can't drift.
class SelfCalibration {
 public:
  SelfCalibration(const OdometryOptions& options, const CameraRig& rig);

  bool Enabled() const { return enabled_; }
  /// The features as a lens without error would have seen them, by what is known so far.
  std::shared_ptr<const FrameFeatures> Correct(const std::shared_ptr<const FrameFeatures>& features) const;
  /// What is known and not taken out of the features yet.
  const LensError& Remaining() const { return remaining_; }
  /// Takes over what a window of so many `keyframes` says (ObserveLens). Where that moves features by a
  /// visible amount, corrects all of the map's.
  void Learn(const LensError& seen, int keyframes, Map* map);
  /// What is taken out of the features: (k1, k2) of LensError.
  const Eigen::Vector2d& Applied() const { return applied_; }
  /// All that is known, and how it came to be.
  LensFound Found() const;

  template <class Archive>
  void State(Archive& archive) {
    archive(applied_, remaining_, steps_);
    if constexpr (Archive::kReading) {
      if (!applied_.allFinite() || !remaining_.value.allFinite() || !remaining_.information.allFinite())
        archive.Damaged("a lens that is none");
    }
  }

 private:
  Eigen::Vector2d Sigma() const;
  double LargestMove(const Eigen::Vector2d& lens) const;
  std::shared_ptr<const FrameFeatures> Moved(const FrameFeatures& features) const;

  PinholeCamera camera_;
  bool enabled_ = false;
  Eigen::Matrix2d first_ = Eigen::Matrix2d::Identity() * 1e12;  // information at the start
  Eigen::Vector2d applied_ = Eigen::Vector2d::Zero();
  LensError remaining_;
  std::vector<LensFound::Step> steps_;
};

}  // namespace tutti
