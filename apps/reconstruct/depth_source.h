// Where the depth of a frame comes from: the sensor, two images, or files that someone else made.
#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "apps/export/map_model.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// A frame that has a pose.
struct PosedFrame {
  std::size_t place = 0;  ///< in the data set, for Dataset::Read
  Pose T_world_camera;
  const ModelKeyframe* keyframe = nullptr;      ///< null: it is none
  Vector6d velocity_before = Vector6d::Zero();  ///< of the camera since the posed frame before, and to the
  Vector6d velocity_after = Vector6d::Zero();   ///< next one, in its own frame (LogSE3) [1/s]; 0: too far

  /// T_world_camera so much later, or earlier where it is negative.
  Pose PoseLater(double seconds) const {
    return T_world_camera * ExpSE3(seconds * (seconds < 0 ? velocity_before : velocity_after));
  }
};

/// A depth image, or why there is none.
struct DepthImageRead {
  cv::Mat depth_m;     ///< CV_32FC1 [m; one camera: in units of the map], 0: no measurement
  std::string error;   ///< empty if there is a depth image
  double later_s = 0;  ///< it was taken so long after the frame's image [s]
};

/// Gives depth images. Thread-safe.
class DepthSource {
 public:
  virtual ~DepthSource() = default;
  virtual DepthImageRead Read(const PosedFrame& frame) const = 0;
  /// True if only keyframes can have depth.
  virtual bool KeyframesOnly() const { return false; }
};

/// Depth [m] of a rectified pair by semi-global matching (H. Hirschmueller, PAMI 2008), CV_32FC1, 0: none.
/// What is nearer than five baselines is not found: a larger range costs time and is wrong more often. `fx`
/// [px].
cv::Mat DepthOfPair(const cv::Mat& left, const cv::Mat& right, double fx, double baseline_m);

/// The depth images of an RGB-D camera; those of stereo pairs (DepthOfPair); or, with `folder`, those in it:
/// as many files as the data set has images, in the order of their names, of the images' size, in any unit.
/// The scale of each is the median over the landmarks that the keyframe sees. Throws InputError where there
/// is no depth, with the ways to get some, and for a folder that does not fit.
std::unique_ptr<DepthSource> OpenDepth(const Dataset& dataset, const MapModel& model,
                                       const std::optional<std::filesystem::path>& folder);

}  // namespace tutti
