#include "frontend/odometry/frame_check.h"

#include <cmath>
#include <string>

#include "frontend/dataset/image_file.h"
#include "tutti/core/error.h"

namespace tutti {

void CheckFrame(const InputFrame& frame, const CameraRig& rig) {
  const auto refuse = [&](const char* field, const std::string& what) {
    throw InputError("frame " + std::to_string(frame.index) + ": " + field + " " + what);
  };
  const auto check = [&](const char* field, const cv::Mat& image, int type, const cv::Size& size) {
    if (image.dims > 2 || image.type() != type)
      refuse(field, "must be " + cv::typeToString(type) + ", and is " + cv::typeToString(image.type()));
    if (image.size() != size)
      refuse(field, "must have " + SizeText(size) + " pixels, and has " + SizeText(image.size()));
  };
  for (const ImuSample& sample : frame.imu) {
    if (!std::isfinite(sample.stamp_s) || !sample.gyro.allFinite() || !sample.acceleration.allFinite())
      refuse("imu", "has a number that is not finite");
  }
  if (frame.image.empty() && frame.image.dims <= 2) {
    if (!frame.features) refuse("image", "is empty");
    return;
  }
  if (!rig.calibrated && (frame.image.type() == CV_8UC3 || frame.image.type() == CV_16UC1)) return;
  if (!rig.calibrated) return check("image", frame.image, CV_8UC1, frame.image.size());
  check("image", frame.image, CV_8UC1, {rig.camera.width, rig.camera.height});
  const cv::Size size = frame.image.size();
  if (!frame.right.empty()) check("right", frame.right, CV_8UC1, size);
  if (!frame.depth_m.empty()) check("depth_m", frame.depth_m, CV_32FC1, size);
  if (!frame.mask.empty()) check("mask", frame.mask, CV_8UC1, size);
}

}  // namespace tutti
