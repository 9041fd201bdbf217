// Calibrations of other programs, as those programs write them.
#include "apps/run/calibration_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/test_data.h"
#include "tutti/core/error.h"

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
  try {
    Read(text, pairs);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(CalibrationFile, OfKalibrGivesItsFirstCamera) {
  const Calibration c = Read(R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.76e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  camera_model: pinhole
  intrinsics: [1, 2, 3, 4]
)");
  EXPECT_EQ(c.format, "Kalibr, cam0 of 2");
  EXPECT_EQ(c.camera.fx, 458.654);
  EXPECT_EQ(c.camera.cy, 248.375);
  EXPECT_EQ(c.camera.width, 752);
  EXPECT_EQ(c.camera.distortion, Distortion::kRadTan);
  EXPECT_EQ(c.camera.coefficients[3], 1.76e-05);
}

TEST(CalibrationFile, OfKalibrMayBeAFisheye) {
  const Calibration c = Read(
      "cam0: {camera_model: pinhole, distortion_model: equidistant, distortion_coeffs: [0.1, 0.2, 0.3, 0.4], "
      "intrinsics: [400, 400, 320, 240], resolution: [640, 480]}\n");
  EXPECT_EQ(c.camera.distortion, Distortion::kEquidistant);
  EXPECT_EQ(c.camera.coefficients[3], 0.4);
}

TEST(CalibrationFile, OfOrbSlam3GivesStereoAndDepthToo) {
  const Calibration c = Read(R"(%YAML:1.0
---
File.version: "1.0"
Camera.type: "PinHole"
Camera1.fx: 535.4
Camera1.fy: 539.2
Camera1.cx: 320.1
Camera1.cy: 247.6
Camera1.k1: 0.1
Camera1.p2: 0.02
Camera.width: 640
Camera.height: 480
Camera.fps: 30
Stereo.b: 0.0745
RGBD.DepthMapFactor: 5208.0
)");
  EXPECT_EQ(c.format, "ORB-SLAM3");
  EXPECT_EQ(c.camera.fy, 539.2);
  EXPECT_EQ(c.camera.coefficients, (DistortionCoefficients{0.1, 0, 0, 0.02, 0}));
  EXPECT_EQ(c.baseline_m, 0.0745);
  EXPECT_EQ(c.depth_units_per_m, 5208);
  EXPECT_EQ(c.rate_hz, 30);
}

TEST(CalibrationFile, OfOrbSlam2HasItsBaselineInPixels) {
  const Calibration c = Read(
      "%YAML:1.0\nCamera.fx: 718.856\nCamera.fy: 718.856\nCamera.cx: 607.2\nCamera.cy: 185.2\n"
      "Camera.k1: 0.0\nCamera.bf: 386.1448\n");
  EXPECT_NEAR(c.baseline_m, 0.537166, 1e-6);
  EXPECT_EQ(c.camera.width, 0);
  EXPECT_EQ(c.camera.distortion, Distortion::kNone);
}

TEST(CalibrationFile, OfOrbSlam3MayBeAFisheye) {
  const Calibration c = Read(
      "%YAML:1.0\nCamera.type: \"KannalaBrandt8\"\nCamera1.fx: 190\nCamera1.fy: 190\nCamera1.cx: 254\n"
      "Camera1.cy: 256\nCamera1.k1: 0.003\nCamera1.k2: 0.0007\nCamera1.k3: -0.002\nCamera1.k4: 0.0002\n");
  EXPECT_EQ(c.camera.distortion, Distortion::kEquidistant);
  EXPECT_EQ(c.camera.coefficients, (DistortionCoefficients{0.003, 0.0007, -0.002, 0.0002, 0}));
}

TEST(CalibrationFile, OfOpenCvHoldsMatrices) {
  const Calibration c = Read(R"(%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 520., 0., 318., 0., 521., 236., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 0.2, -0.4, 0.001, 0.002, 0.1 ]
)");
  EXPECT_EQ(c.format, "OpenCV");
  EXPECT_EQ(c.camera.fy, 521);
  EXPECT_EQ(c.camera.cx, 318);
  EXPECT_EQ(c.camera.coefficients[4], 0.1);
}

TEST(CalibrationFile, OfRosNamesItsModel) {
  const Calibration c = Read(
      "image_width: 640\nimage_height: 480\ncamera_name: front\n"
      "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n"
      "distortion_model: plumb_bob\n"
      "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n");
  EXPECT_EQ(c.format, "ROS");
  EXPECT_EQ(c.camera.distortion, Distortion::kNone);
  EXPECT_EQ(c.camera.fx, 500);
}

TEST(CalibrationFile, OfTuttiIsItsCameraSection) {
  const Calibration c = Read(
      "camera:\n  width: 640\n  height: 480\n  fx: 500\n  fy: 500\n  cx: 320\n  cy: 240\n  baseline_m: "
      "0.1\n");
  EXPECT_EQ(c.format, "tutti");
  EXPECT_EQ(c.baseline_m, 0.1);
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
  EXPECT_EQ(c.camera.fx, 400);
  ASSERT_TRUE(c.right);
  EXPECT_EQ(c.right->fx, 410);
  EXPECT_EQ(c.right->distortion, Distortion::kRadTan);
  EXPECT_EQ(c.T_right_left, (TransformRows{1, 0, 0, -0.11, 0, 1, 0, 0, 0, 0, 1, 0.02, 0, 0, 0, 1}));
  EXPECT_FALSE(Read(file).right) << "one camera is wanted";
}

TEST(CalibrationFile, OfOrbSlam3GivesTheRightCameraOfPairs) {
  const Calibration c = Read(R"(%YAML:1.0
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
Stereo.b: 0.11
Stereo.T_c1_c2: !!opencv-matrix
  rows: 4
  cols: 4
  dt: f
  data: [1, 0, 0, 0.11,
         0, 1, 0, 0,
         0, 0, 1, -0.02,
         0, 0, 0, 1]
)",
                             true);
  ASSERT_TRUE(c.right);
  EXPECT_EQ(c.right->cx, 379.9);
  EXPECT_EQ(c.right->width, 752);
  EXPECT_EQ(c.right->coefficients[0], -0.28);
  EXPECT_EQ(c.baseline_m, 0) << "the transform has it";
  EXPECT_NEAR(c.T_right_left[3], -0.11, 1e-12);  // the inverse: of points of the left camera
  EXPECT_NEAR(c.T_right_left[11], 0.02, 1e-12);
}

TEST(CalibrationFile, OfPairsThatCantBeUsedIsRefused) {
  EXPECT_THAT(RefusalOfFile(Camchain("[[1, 0], [0, 1], [0, 0], [0, 0]]"), true),
              HasSubstr("'T_cn_cnm1' has 8 values; 16 are needed"));
  EXPECT_THAT(RefusalOfFile(Camchain("[2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]"), true),
              HasSubstr("'T_cn_cnm1' is not a rigid transform"));
  EXPECT_THAT(RefusalOfFile(Camchain("[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]"), true),
              HasSubstr("'T_cn_cnm1' is zeros"));
  EXPECT_THAT(RefusalOfFile(Camchain("5"), true), HasSubstr("'T_cn_cnm1' has 1 values; 16 are needed"));
  EXPECT_THAT(RefusalOfFile(Camchain("[[1, 0, 0, -110], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"), true),
              HasSubstr("are these millimetres?"));
}

TEST(CalibrationFile, ThatCantBeUsedIsRefusedWithLineAndReason) {
  EXPECT_THAT(RefusalOfFile("hello: 1\n"), HasSubstr("camera.yaml: holds no calibration; the formats"));
  EXPECT_THAT(RefusalOfFile("- 1\n"), HasSubstr("holds no keys"));
  EXPECT_THAT(RefusalOfFile("a: [1\n"), HasSubstr("not valid YAML"));
  EXPECT_THAT(RefusalOfFile("Camera.fx: 500\nCamera.fy: x\nCamera.cx: 1\nCamera.cy: 1\n"),
              HasSubstr("camera.yaml:2: 'Camera.fy' is no number"));
  EXPECT_THAT(RefusalOfFile("Camera.fx: .nan\nCamera.fy: 5\nCamera.cx: 1\nCamera.cy: 1\n"),
              HasSubstr("'Camera.fx' is not finite"));
  EXPECT_THAT(RefusalOfFile("Camera.fx: 500\nCamera.cx: 1\nCamera.cy: 1\n"),
              HasSubstr("has no key 'Camera.fy'"));
  EXPECT_THAT(RefusalOfFile("cam0:\n  camera_model: omni\n  intrinsics: [1, 2, 3, 4, 5]\n"),
              HasSubstr("camera.yaml:2: the lens model 'omni' is none that tutti has"));
  EXPECT_THAT(RefusalOfFile("cam0:\n  intrinsics: [1, 2, 3]\n"), HasSubstr("has 3 values"));
  EXPECT_THAT(RefusalOfFile("cam0:\n  intrinsics: [500, 500, 320, 240]\n  distortion_model: fov\n"
                            "  distortion_coeffs: [0.9, 0, 0, 0]\n"),
              HasSubstr("camera.yaml:4: the lens model 'fov' is none that tutti has"));
  EXPECT_THAT(RefusalOfFile("camera_matrix: {data: [1, 2]}\n"), HasSubstr("has 2 values; 9 are needed"));
  EXPECT_THAT(RefusalOfFile("camera_matrix: {data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n"
                            "distortion_coefficients: {data: [0.1, 0, 0, 0, 0, 0.3, 0, 0]}\n"),
              HasSubstr("more than 5 coefficients"));
  EXPECT_THAT(RefusalOfFile("Camera.fx: -500\nCamera.fy: 500\nCamera.cx: 320\nCamera.cy: 240\n"),
              HasSubstr("camera.fx"));
}

TEST(CalibrationFile, WithANumberThatIsNoSizeIsRefused) {
  const std::string lens = "intrinsics: [400, 400, 320, 240]\n";
  EXPECT_THAT(RefusalOfFile("cam0: {intrinsics: [400, 400, 320, 240], resolution: [1e300, 480]}\n"),
              HasSubstr("camera.width"));
  EXPECT_THAT(RefusalOfFile(lens + "resolution: [752, 1e300]\ndistortion_model: none\n"),
              HasSubstr("camera.height"));
  EXPECT_THAT(RefusalOfFile("Camera.fx: 500\nCamera.fy: 500\nCamera.cx: 1e300\nCamera.cy: 240\n"),
              HasSubstr("camera.width"));
  EXPECT_THAT(RefusalOfFile("Camera.fx: 500\nCamera.fy: 500\nCamera.cx: 320\nCamera.cy: 240\n"
                            "Camera.width: -1e20\nCamera.height: 480\n"),
              HasSubstr("camera.width"));
}

TEST(CalibrationFile, OfEurocIsReadAsItsDataSetsAre) {
  const Calibration c = Read(R"(sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, 0.1,
         0.0, 1.0, 0.0, 0.2,
         0.0, 0.0, 1.0, 0.3,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
)");
  EXPECT_EQ(c.format, "EuRoC");
  EXPECT_EQ(c.camera.fy, 457.296);
  EXPECT_EQ(c.camera.height, 480);
  EXPECT_EQ(c.camera.distortion, Distortion::kRadTan);
  EXPECT_EQ(c.rate_hz, 20);
  EXPECT_THAT(RefusalOfFile("intrinsics: [1, 2, 3]\nresolution: [64, 48]\n"),
              HasSubstr("camera.yaml:1: 'intrinsics' has 3 values; 4 are needed"));
  EXPECT_THAT(RefusalOfFile("camera_model: omni\nintrinsics: [1, 2, 3, 4]\n"),
              HasSubstr("camera.yaml:1: the lens model 'omni' is none that tutti has"));
}

TEST(CalibrationFile, ThatIsNotThereIsNamed) {
  try {
    ReadCalibration("/nowhere/camera.yaml");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/nowhere/camera.yaml: can't be opened"));
  }
}

TEST(CalibrationFile, BesideTheImagesIsFoundByItsUsualNames) {
  const fs::path folder = testing::FreshFolder();
  EXPECT_FALSE(CalibrationBeside(folder));
  std::ofstream(folder / "camchain.yaml") << "\n";
  EXPECT_EQ(CalibrationBeside(folder), folder / "camchain.yaml");
}

}  // namespace
}  // namespace tutti
