#include "apps/tutti/camera_options.h"

#include "apps/tutti/checks.h"
#include "core/camera_text.h"

namespace tutti::cli {

void AddCameraOptions(CLI::App& command, CameraWords& words) {
  command.add_option(
      "--calibration", words.calibration,
      "the camera from the file of another program: Kalibr, ORB-SLAM, stella_vslam, VINS, Basalt, OpenCV, "
      "ROS, EuRoC, KITTI, COLMAP, nerfstudio, Open3D, RealSense, ...; with --sensor stereo also the right "
      "one, where the file has it");
  command.add_option("--camera", words.camera,
                     std::string("the camera as ") + internal::kCameraText + " in pixels");
  command
      .add_option("--fov", words.view_deg,
                  "the camera by its horizontal field of view [deg], principal point in the middle")
      ->check(NumberThat([](double v) { return v >= 5 && v <= 170; }, "from 5 to 170", "DEGREES"));
  command.add_option("--sensor", words.sensor, "what to use of the recording; default: all that is there")
      ->check(OneOf(Sensor()));
}

CameraRequest CameraOf(const CLI::App& command, const CameraWords& words) {
  CameraRequest camera;
  if (!words.calibration.empty()) camera.calibration = words.calibration;
  camera.camera = words.camera;
  if (command.count("--fov") > 0) camera.view_deg = words.view_deg;
  for (const auto& [word, value] : WordsOf(Sensor())) {
    if (words.sensor == word) camera.sensor = value;
  }
  return camera;
}

}  // namespace tutti::cli
