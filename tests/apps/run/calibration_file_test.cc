// Calibrations of other programs, as those programs write them.
#include "apps/run/calibration_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

Calibration Read(const std::string& text, bool pairs = false) {
  const fs::path file = testing::FreshFolder() / "camera.yaml";
  std::ofstream(file) << text;
  return ReadCalibration(file, pairs);
}

std::string RefusalOfFile(const std::string& text, bool pairs = false) {
  return testing::ErrorOf([&] { Read(text, pairs); });
}

// A camchain of two cameras, cam1 with this transform from cam0.
std::string Camchain(const std::string& T_cn_cnm1) {
  return "cam0: {camera_model: pinhole, intrinsics: [400, 401, 320, 240], resolution: [640, 480]}\n"
         "cam1:\n  T_cn_cnm1: " +
         T_cn_cnm1 +
         "\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [0.1, 0.2, 0, 0]\n"
         "  intrinsics: [410, 411, 321, 241]\n  resolution: [640, 480]\n";
}

TEST(CalibrationFile, OfKalibrGivesTheRightCameraOfPairs) {
  const std::string file = Camchain("[[1, 0, 0, -0.11], [0, 1, 0, 0], [0, 0, 1, 0.02], [0, 0, 0, 1]]");
  const Calibration c = Read(file, true);
  EXPECT_EQ(c.format, "Kalibr, cam0 of 2");
  EXPECT_EQ(c.camera.fx, 400);
  ASSERT_TRUE(c.right);
  EXPECT_EQ(c.right->fx, 410);
  EXPECT_EQ(c.right->distortion, Distortion::kRadTan);
  EXPECT_EQ(c.T_right_left, (TransformRows{1, 0, 0, -0.11, 0, 1, 0, 0, 0, 0, 1, 0.02, 0, 0, 0, 1}));
  EXPECT_FALSE(Read(file).right) << "one camera is wanted";
}

TEST(CalibrationFile, OfOrbSlam3GivesTheRightCameraOfPairs) {
  const std::string file = R"(%YAML:1.0
File.version: "1.0"
Camera.type: "PinHole"
Camera1.fx: 458.6
Camera1.fy: 457.2
Camera1.cx: 367.2
Camera1.cy: 248.3
Camera2.fx: 457.5
Camera2.fy: 456.1
Camera2.cx: 379.9
Camera2.cy: 255.2
Camera2.k1: -0.28
Camera.width: 752
Camera.height: 480
Camera.fps: 30
RGBD.DepthMapFactor: 5208.0
Stereo.b: 0.11
Stereo.T_c1_c2: !!opencv-matrix
  rows: 4
  cols: 4
  dt: f
  data: [1, 0, 0, 0.11,
         0, 1, 0, 0,
         0, 0, 1, -0.02,
         0, 0, 0, 1]
)";
  const Calibration one = Read(file), c = Read(file, true);
  EXPECT_EQ(one.format, "ORB-SLAM3");
  EXPECT_EQ(one.camera.fy, 457.2);
  EXPECT_EQ(one.baseline_m, 0.11);
  EXPECT_EQ(one.depth_units_per_m, 5208);
  EXPECT_EQ(one.rate_hz, 30);
  ASSERT_TRUE(c.right);
  EXPECT_EQ(c.right->cx, 379.9);
  EXPECT_EQ(c.right->width, 752);
  EXPECT_EQ(c.right->coefficients[0], -0.28);
  EXPECT_EQ(c.baseline_m, 0) << "the transform has it";
  EXPECT_NEAR(c.T_right_left[3], -0.11, 1e-12);  // the inverse: of points of the left camera
  EXPECT_NEAR(c.T_right_left[11], 0.02, 1e-12);
}

TEST(CalibrationFile, OfPairsThatCantBeUsedIsRefused) {
  for (const auto& [T, why] :
       {std::pair("[[1, 0], [0, 1], [0, 0], [0, 0]]", "'T_cn_cnm1' has 8 values; 16 are needed"),
        {"[2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]", "'T_cn_cnm1' is not a rigid transform"},
        {"[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]", "'T_cn_cnm1' is zeros"},
        {"5", "'T_cn_cnm1' has 1 values; 16 are needed"},
        {"[[1, 0, 0, -110], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]", "are these millimetres?"}})
    EXPECT_THAT(RefusalOfFile(Camchain(T), true), HasSubstr(why));
}

TEST(CalibrationFile, ThatCantBeUsedIsRefusedWithLineAndReason) {
  for (const auto& [text, why] :
       {std::pair("hello: 1\n", "camera.yaml: holds no calibration; the formats"),
        {"- 1\n", "holds no keys"},
        {"a: [1\n", "not valid YAML"},
        {"Camera.fx: 500\nCamera.fy: x\nCamera.cx: 1\nCamera.cy: 1\n",
         "camera.yaml:2: 'Camera.fy' is no number"},
        {"Camera.fx: .nan\nCamera.fy: 5\nCamera.cx: 1\nCamera.cy: 1\n", "'Camera.fx' is not finite"},
        {"Camera.fx: 500\nCamera.cx: 1\nCamera.cy: 1\n", "has no key 'Camera.fy'"},
        {"cam0:\n  camera_model: omni\n  intrinsics: [1, 2, 3, 4, 5]\n",
         "camera.yaml:2: the lens model 'omni' is none that tutti has"},
        {"cam0:\n  intrinsics: [1, 2, 3]\n", "has 3 values"},
        {"cam0:\n  intrinsics: [500, 500, 320, 240]\n  distortion_model: fov\n"
         "  distortion_coeffs: [0.9, 0, 0, 0]\n",
         "camera.yaml:4: the lens model 'fov' is none that tutti has"},
        {"intrinsics: [1, 2, 3]\nresolution: [64, 48]\n",
         "camera.yaml:1: 'intrinsics' has 3 values; 4 are needed"},
        {"camera_model: omni\nintrinsics: [1, 2, 3, 4]\n",
         "camera.yaml:1: the lens model 'omni' is none that tutti has"},
        {"camera_matrix: {data: [1, 2]}\n", "has 2 values; 9 are needed"},
        {"camera_matrix: {data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n"
         "distortion_coefficients: {data: [0.1, 0, 0, 0, 0, 0.3, 0, 0]}\n",
         "more than 5 coefficients"},
        {"Camera.fx: -500\nCamera.fy: 500\nCamera.cx: 320\nCamera.cy: 240\n", "camera.fx"},
        // Numbers that are no sizes.
        {"cam0: {intrinsics: [400, 400, 320, 240], resolution: [1e300, 480]}\n", "camera.width"},
        {"intrinsics: [400, 400, 320, 240]\nresolution: [752, 1e300]\ndistortion_model: none\n",
         "camera.height"},
        {"Camera.fx: 500\nCamera.fy: 500\nCamera.cx: 1e300\nCamera.cy: 240\n", "camera.width"},
        {"Camera.fx: 500\nCamera.fy: 500\nCamera.cx: 320\nCamera.cy: 240\nCamera.width: -1e20\n"
         "Camera.height: 480\n",
         "camera.width"}})
    EXPECT_THAT(RefusalOfFile(text), HasSubstr(why)) << text;
}

TEST(CalibrationFile, ThatIsNotThereIsNamed) {
  EXPECT_THAT(testing::ErrorOf([] { ReadCalibration("/nowhere/camera.yaml"); }),
              HasSubstr("/nowhere/camera.yaml: can't be opened"));
}

TEST(CalibrationFile, BesideTheImagesIsFoundByItsUsualNames) {
  const fs::path folder = testing::FreshFolder();
  EXPECT_FALSE(CalibrationBeside(folder));
  std::ofstream(folder / "camchain.yaml") << "\n";
  EXPECT_EQ(CalibrationBeside(folder), folder / "camchain.yaml");
}

}  // namespace
}  // namespace tutti
