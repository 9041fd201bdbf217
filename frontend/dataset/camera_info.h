// What sensor_msgs/CameraInfo means, in bags and in files.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

#pragma GCC visibility push(default)  // of `tutti run --calibration`, too
namespace tutti {

/// The part of the sensor that an image shows (REP 104): first a region of interest is cut out, then
/// `binning` x `binning` pixels become one. Zeros: all of it, unbinned.
struct ImageWindow {
  int binning_x = 0, binning_y = 0;
  int x_offset = 0, y_offset = 0, width = 0, height = 0;  ///< region of interest [px], unbinned

  bool IsWhole() const;
  std::string Text() const;  ///< "binning 2x2, region 320x240 at (160, 120)"
};

/// The camera of the images that a window of the calibrated ones makes: a binned pixel's centre is the middle
/// of those that it is made of. `camera` may be without a size. Throws InputError for a window that does not
/// fit; the message begins with `source`.
PinholeCamera Windowed(PinholeCamera camera, const ImageWindow& window, const std::string& source);

/// The message. Sizes, K, R and P are those of whole, unbinned images.
struct CameraInfo {
  int width = 0, height = 0;
  std::string model;
  std::vector<double> lens;   ///< D
  std::array<double, 9> K{};  ///< of raw images, row by row; K[0] = 0: not calibrated
  std::array<double, 9> R{};
  std::array<double, 12> P{};  ///< of rectified images; P[3] = -fx * distance from the left camera [m]
  ImageWindow window;

  bool IsCalibrated() const { return K[0] > 0; }
  /// The camera of raw images; throws InputError, which begins with `source`, for a lens that tutti has not.
  PinholeCamera Raw(const std::string& source) const;
  PinholeCamera Rectified() const;
};

/// Where the right camera of raw pairs is, from the rotations that rectify them (OpenCV's R1 and R2, the R of
/// two camera_infos) and the distance of the rectified cameras [m]. Throws InputError, whose message is to
/// follow the name of these rotations, for what is no rotation.
Pose TransformOfRectified(const std::array<double, 9>& R_left, const std::array<double, 9>& R_right,
                          double baseline_m);

}  // namespace tutti
#pragma GCC visibility pop
