// Which images show the same place, by what they see of it: depth of one, looked up in the other.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"
#include "tutti/loopclosure/ground_truth.h"

#pragma GCC visibility push(default)  // of the commands, too
namespace tutti::internal {

/// What an image sees, coarsely: its depth at every few pixels, and points of a grid of 24 x 18 over it.
class DepthView {
 public:
  /// `depth_m`: CV_32FC1 [m], 0 = unknown; `camera`: of its pixels, without distortion. Keeps no reference.
  /// Throws InputError where the camera has another size than the depth.
  DepthView(const Pose& T_world_camera, const PinholeCamera& camera, const cv::Mat& depth_m);

  /// Share of what this image sees that `other` sees, too, 0..1: of the grid's points with a depth, those
  /// that lie in the other image and at the depth which that has there, within 5 cm and 5 %. A point is in
  /// doubt, and not counted, where the other image has no depth. Nothing where less than a quarter of the
  /// grid is left: the depth says too little.
  std::optional<double> SeenBy(const DepthView& other) const;
  /// Angle between the two cameras' orientations [deg], 0..180.
  double AngleTo(const DepthView& other) const;

 private:
  enum class Sight { kSeen, kNotSeen, kDoubt };
  Sight Look(const Eigen::Vector3f& point) const;

  Pose T_world_camera_;
  float fx_, fy_, cx_, cy_;              // of coarse_
  cv::Mat coarse_;                       // CV_32FC1
  std::vector<Eigen::Vector3f> points_;  // in the camera's frame [m]
};

/// When two images show the same place, by what they see of each other.
struct OverlapRule {
  double share = 0.3;         ///< loop: one sees at least this share of what the other sees, 0..1
  double ignore_share = 0.1;  ///< no loop: neither sees as much as this of the other, 0..share; between the
                              ///< two, and where depth says too little, a pair is ignored
  double exclude_s = 10.0;    ///< a loop is at least this much older [s]; younger pairs are ignored

  /// Empty if usable, else what is wrong and what to do.
  std::string Validate() const;
};

/// Labels of all pairs, with LoopGroundTruth::best_views. `views`: nothing for an image of which nothing is
/// known, whose pairs are ignored. `stamps_s`: one for each. Throws InputError for a rule that can't be used.
LoopGroundTruth LoopsFromOverlap(const std::vector<std::optional<DepthView>>& views,
                                 const std::vector<double>& stamps_s, const OverlapRule& rule);

}  // namespace tutti::internal
#pragma GCC visibility pop
