#include "frontend/dataset/rectified_rig.h"

#include <cmath>
#include <utility>

#include "core/numbers.h"
#include "frontend/dataset/image_file.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

// Checked, and with the size of the images where it has none; `which`: "right ", or "".
PinholeCamera Fitting(const std::string& name, const char* which, PinholeCamera camera, cv::Size size) {
  if (camera.width == 0 && camera.height == 0) {
    camera.width = size.width;
    camera.height = size.height;
  }
  const cv::Size calibrated(camera.width, camera.height);
  if (calibrated != size)
    throw InputError(name + ": the " + which + "camera is calibrated for images of " + SizeText(calibrated) +
                     ", but the images have " + SizeText(size) + "; use the calibration of this camera");
  const std::string problem = camera.Validate();
  if (!problem.empty()) throw InputError(name + ": " + which + problem);
  return camera;
}

void RectifyPairs(const std::string& name, const PinholeCamera& left, const RigCalibration& calibration,
                  const DatasetOptions& options, cv::Size size, RectifiedRig& out) {
  StereoRectification stereo =
      RectifyStereo(left, Fitting(name, "right ", *calibration.right, size), *calibration.T_right_left);
  if (options.right && options.baseline_m > 0 &&
      std::abs(options.baseline_m - stereo.baseline_m) > 0.01 * stereo.baseline_m)
    throw InputError(name + ": camera.baseline_m is " + std::to_string(options.baseline_m) +
                     " m, but the cameras of camera.right.T_right_left lie " +
                     std::to_string(stereo.baseline_m) +
                     " m apart; leave baseline_m out, which is of rectified pairs");
  out.left = std::move(stereo.left);
  out.right = std::move(stereo.right);
  out.rig.baseline_m = stereo.baseline_m;
  out.rig.T_body_camera = calibration.T_body_left * stereo.T_left_rectified;
}

void TakeRectifiedPairs(const std::string& name, const PinholeCamera& left, double baseline_m,
                        RectifiedRig& out) {
  if (left.distortion != Distortion::kNone)
    throw InputError(name +
                     ": stereo pairs must be rectified, but the camera has distortion; of raw pairs give the "
                     "right camera, "
                     "too (camera.right, or a sensor.yaml for each in the EuRoC layout), of rectified ones "
                     "set it to none");
  if (!(baseline_m > 0))
    throw InputError(name +
                     ": the distance of the two cameras is not known; set camera.baseline_m [m], or add "
                     "calib.txt with P1 (KITTI), or give the right camera (camera.right) of raw pairs");
  out.rig.baseline_m = baseline_m;
}

}  // namespace

PinholeCamera CameraOfView(double degrees, cv::Size size) {
  const double f = 0.5 * size.width / std::tan(0.5 * degrees / internal::kDegrees);
  return Pinhole(f, f, 0.5 * (size.width - 1), 0.5 * (size.height - 1), size);
}

RectifiedRig RectifyRig(const std::string& name, RigCalibration calibration, const DatasetOptions& options,
                        cv::Size size, double rate_hz) {
  RectifiedRig out;
  CameraRig& rig = out.rig;
  const bool stereo = options.sensor == Sensor::kStereo;
  rig.sensor = options.sensor;
  rig.rate_hz = rate_hz;
  rig.max_depth_m = options.max_depth_m;
  rig.depth_delay_s = options.depth_delay_s;
  rig.T_body_camera = calibration.T_body_left;
  if (stereo && options.right) {
    calibration.right = options.right;
    calibration.T_right_left = RigidTransform(options.T_right_left);
  }
  if (!calibration.left && options.fov_deg > 0) calibration.left = CameraOfView(options.fov_deg, size);
  if (!calibration.left) {
    if (stereo && options.right)
      throw InputError(name +
                       ": camera.right is given, but not the left camera; set its fx, fy, cx and cy "
                       "under 'camera:', too");
    rig.calibrated = false;
    rig.camera = Pinhole(0, 0, 0, 0, size);
    return out;
  }
  const PinholeCamera left = Fitting(name, "", *calibration.left, size);
  if (stereo && calibration.right && calibration.T_right_left) {
    RectifyPairs(name, left, calibration, options, size, out);
  } else {
    if (stereo) TakeRectifiedPairs(name, left, calibration.baseline_m, out);
    out.left.emplace(left);
  }
  rig.camera = out.left->Camera();
  rig.readout_s = RectifiedReadout(options.readout_s, left, rig.camera);
  return out;
}

RectifiedRig RectifyRig(const std::string& name, const DatasetOptions& options, cv::Size size, double rate_hz,
                        std::vector<std::string>& warnings) {
  RigCalibration calibration;
  calibration.left = options.camera;
  calibration.baseline_m = options.baseline_m;
  RectifiedRig out = RectifyRig(name, std::move(calibration), options, size, rate_hz);
  if (!out.rig.calibrated) warnings.push_back(NoCalibrationText(name));
  return out;
}

}  // namespace tutti
