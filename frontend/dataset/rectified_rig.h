// From the calibration of a data set to what rectifies its images: one way for folders, videos, bags and
// cameras.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "frontend/features/rectifier.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// What is known of the cameras before rectification.
struct RigCalibration {
  std::optional<PinholeCamera> left, right;  ///< as calibrated; width and height 0: the images'
  std::optional<Pose> T_right_left;          ///< with `right`: pairs need rectification
  double baseline_m = 0;                     ///< of pairs that are rectified already
  Pose T_body_left;                          ///< left camera as calibrated -> body
};

/// The rig after rectification, and what makes its images; nothing: they pass as they are.
struct RectifiedRig {
  CameraRig rig;
  std::optional<Rectifier> left, right;
};

/// A camera without distortion; without a size it has that of its images.
inline PinholeCamera Pinhole(double fx, double fy, double cx, double cy, cv::Size size = {}) {
  PinholeCamera camera;
  camera.width = size.width, camera.height = size.height;
  camera.fx = fx, camera.fy = fy, camera.cx = cx, camera.cy = cy;
  return camera;
}

/// The image as the rectifier makes it, or as it is.
inline cv::Mat Rectified(const std::optional<Rectifier>& rectifier, const cv::Mat& image,
                         Sampling sampling = Sampling::kLinear) {
  return rectifier ? rectifier->Apply(image, sampling) : image;
}

/// The camera with this horizontal field of view [deg]: square pixels, principal point in the middle.
PinholeCamera CameraOfView(double degrees, cv::Size size);

/// What a data set without a calibration says of itself. `name`: what messages call it.
inline std::string NoCalibrationText(const std::string& name) {
  return name + ": no calibration is given (camera: fx, fy, cx, cy); appearance only, no odometry";
}

/// The rig of images of this size. options.right goes before calibration.right. Without a left camera it
/// has options.fov_deg; without that the rig is not calibrated. `name` is what messages call the data set.
/// Throws InputError if the calibration is that of another size, or can't be used, and for pairs that it does
/// not suffice for.
RectifiedRig RectifyRig(const std::string& name, RigCalibration calibration, const DatasetOptions& options,
                        cv::Size size, double rate_hz);

/// Uses what `options` say alone; adds NoCalibrationText to `warnings` where they have none.
RectifiedRig RectifyRig(const std::string& name, const DatasetOptions& options, cv::Size size, double rate_hz,
                        std::vector<std::string>& warnings);

}  // namespace tutti
