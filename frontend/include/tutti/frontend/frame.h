// What a sensor delivers: one frame, and the rig that took it. Frames are rectified: a Dataset removes the
// lens distortion and aligns stereo pairs before anything else sees an image.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/imu.h"
#include "tutti/core/options.h"
#include "tutti/core/pose.h"

#pragma GCC visibility push(default)
namespace tutti {

struct FrameFeatures;

enum class Sensor { kMono, kStereo, kRgbd };
/// The words of the YAML files.
EnumWords<Sensor> WordsOf(Sensor);

/// The sensor after rectification.
struct CameraRig {
  Sensor sensor = Sensor::kMono;
  PinholeCamera camera;      ///< left (or only, or colour) camera; no distortion left
  double baseline_m = 0;     ///< stereo: distance of the right camera along +x of the left one [m]
  Pose T_body_camera;        ///< camera -> the frame that ground truth is of (identity for KITTI and TUM)
  double rate_hz = 10;       ///< nominal frame rate [1/s]
  double max_depth_m = 0;    ///< RGB-D: depth beyond this is not used [m]; 0 = no limit
  double readout_s = 0;      ///< rolling shutter: the last row is read so long after the first [s]
  double depth_delay_s = 0;  ///< RGB-D: a depth image was taken so long before its time stamp [s]
  bool calibrated = true;    ///< false: appearance only (no odometry is possible)
  std::optional<ImuCalibration> imu;  ///< what is known of an IMU on it; none: nothing
};

/// One rectified frame.
struct InputFrame {
  std::int64_t index = 0;  ///< 0-based index of the (left, colour) image in its data set (Dataset::Number)
  double stamp_s = 0;      ///< time stamp [s]
  cv::Mat image;           ///< CV_8UC1, left (or only) camera
  cv::Mat right;           ///< stereo: CV_8UC1, same size as image; else, or where it is absent, empty
  cv::Mat depth_m;     ///< RGB-D: CV_32FC1 [m], registered to image, 0 = no measurement; else, or where it
                       ///< is absent, empty
  double clock_s = 0;  ///< a regular clock says so much more than stamp_s, which jitters [s]
  double depth_later_s = 0;  ///< RGB-D: time stamp of the depth image less that of image, by such clocks [s]
  std::vector<ImuSample> imu;  ///< optional: measurements since the frame before, in order of time; those
                               ///< that came a little after the image may be among them
  cv::Mat mask;                ///< optional: CV_8UC1, same size as image; there are no features where it is 0
  std::shared_ptr<const FrameFeatures>
      features;  ///< optional: Odometry::Extract's result, made on another thread
};

}  // namespace tutti
#pragma GCC visibility pop
