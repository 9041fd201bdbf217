// One camera in the files of many programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "apps/run/calibration_file.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

Calibration ReadText(const std::string& text, bool pairs = false) {
  const fs::path file = testing::FreshFolder() / "camera.yaml";
  std::ofstream(file) << text;
  return ReadCalibration(file, pairs);
}

std::string RefusalOfText(const std::string& text, bool pairs = false) {
  return testing::ErrorOf([&] { ReadText(text, pairs); });
}

// The lens that the files of several programs describe.
PinholeCamera Fisheye() {
  PinholeCamera c;
  c.width = 320;
  c.height = 240;
  c.fx = c.fy = 295;
  c.cx = 159.5;
  c.cy = 119.5;
  c.distortion = Distortion::kEquidistant;
  c.coefficients = {0.1, -0.05, 0.02, -0.01, 0};
  return c;
}
PinholeCamera RadTan() {
  PinholeCamera c = Fisheye();
  c.distortion = Distortion::kRadTan;
  c.coefficients = {0.1, -0.05, 0.001, -0.002, 0};
  return c;
}
PinholeCamera Plain() {
  PinholeCamera c = Fisheye();
  c.distortion = Distortion::kNone;
  c.coefficients = {};
  return c;
}

std::string CameraAsText(const PinholeCamera& c) {
  std::ostringstream out;
  out << c.width << "x" << c.height << " " << c.fx << " " << c.fy << " " << c.cx << " " << c.cy << " lens "
      << int(c.distortion);
  for (const double k : c.coefficients) out << " " << k;
  return out.str();
}

void ExpectAll(const PinholeCamera& wanted, const std::vector<std::string>& files) {
  for (const std::string& file : files) {
    try {
      EXPECT_EQ(CameraAsText(ReadText(file).camera), CameraAsText(wanted)) << file;
    } catch (const InputError& e) {
      ADD_FAILURE() << e.what() << "\n" << file;
    }
  }
}

const std::string kFlat = "Camera.fx: 295\nCamera.fy: 295\nCamera.cx: 159.5\nCamera.cy: 119.5\n";
const std::string kKMatrix = "{rows: 3, cols: 3, data: [295, 0, 159.5, 0, 295, 119.5, 0, 0, 1]}\n";
const std::string kKOfOpenCv =
    "image_width: 320\nimage_height: 240\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data:[ 295., 0., 159.5, 0., 295., 119.5, 0., 0., 1. ]\n";

TEST(CalibrationFormats, OfOneFisheyeIsTheSameCameraInEveryFormat) {
  const std::string terms = "Camera.k1: 0.1\nCamera.k2: -0.05\nCamera.k3: 0.02\nCamera.k4: -0.01\n";
  const std::string size = "Camera.cols: 320\nCamera.rows: 240\n";
  ExpectAll(
      Fisheye(),
      {kFlat + terms + size + "Camera.model: \"fisheye\"\n",
       "Camera.fx:295\nCamera.fy:295\nCamera.cx:159.5\nCamera.cy:119.5\n" + terms + size +
           "Camera.model: fisheye\n",
       kFlat + terms + "Camera.width: 320\nCamera.height: 240\nCamera.type: \"KannalaBrandt8\"\n",
       "Camera.type: KannalaBrandt8\nCamera1.fx: 295\nCamera1.fy: 295\nCamera1.cx: 159.5\nCamera1.cy: 119.5\n"
       "Camera1.k1: 0.1\nCamera1.k2: -0.05\nCamera1.k3: 0.02\nCamera1.k4: -0.01\nCamera.width: 320\n"
       "Camera.height: 240\n",
       "Camera:\n  model: fisheye\n  fx: 295\n  fy: 295\n  cx: 159.5\n  cy: 119.5\n  k1: 0.1\n  k2: -0.05\n"
       "  k3: 0.02\n  k4: -0.01\n  cols: 320\n  rows: 240\n",
       "cam0: {camera_model: pinhole, distortion_model: equidistant, distortion_coeffs: [0.1, -0.05, 0.02, "
       "-0.01], intrinsics: [295, 295, 159.5, 119.5], resolution: [320, 240]}\n",
       "%YAML:1.0\n---\n" + kKOfOpenCv +
           "fisheye_model: 1\ndistortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n"
           "   data:[ 0.1, -0.05, 0.02, -0.01 ]\n",
       "image_width: 320\nimage_height: 240\ncamera_matrix: " + kKMatrix +
           "distortion_model: fisheye\ndistortion_coefficients: [[0.1], [-0.05], [0.02], [-0.01]]\n",
       "%YAML:1.0\n---\nmodel_type: KANNALA_BRANDT\nimage_width: 320\nimage_height: 240\n"
       "projection_parameters:\n   k2: 0.1\n   k3: -0.05\n   k4: 0.02\n   k5: -0.01\n   mu: 295\n   mv: 295\n"
       "   u0: 159.5\n   v0: 119.5\n",
       R"({"value0": {"T_imu_cam": [], "intrinsics": [{"camera_type": "kb4", "intrinsics": {"fx": 295, "fy": 295,
          "cx": 159.5, "cy": 119.5, "k1": 0.1, "k2": -0.05, "k3": 0.02, "k4": -0.01}}],
          "resolution": [[320, 240]]}})",
       R"({"camera_model": "OPENCV_FISHEYE", "fl_x": 295, "fl_y": 295, "cx": 160, "cy": 120, "w": 320, "h": 240,
          "k1": 0.1, "k2": -0.05, "k3": 0.02, "k4": -0.01, "frames": []})",
       R"({"is_fisheye": true, "fl_x": 295, "cx": 160, "cy": 120, "w": 320, "h": 240,
          "k1": 0.1, "k2": -0.05, "k3": 0.02, "k4": -0.01})",
       "# Camera list\n1 OPENCV_FISHEYE 320 240 295 295 160 120 0.1 -0.05 0.02 -0.01\n",
       R"({"width": 320, "height": 240, "fx": 295, "fy": 295, "ppx": 159.5, "ppy": 119.5,
          "model": "distortion.kannala_brandt4", "coeffs": [0.1, -0.05, 0.02, -0.01, 0]})",
       "cameras:\n- camera:\n    label: a\n    image_height: 240\n    image_width: 320\n    type: pinhole\n"
       "    intrinsics: {cols: 1, rows: 4, data: [295, 295, 159.5, 119.5]}\n    distortion:\n"
       "      type: equidistant\n      parameters: {cols: 1, rows: 4, data: [0.1, -0.05, 0.02, -0.01]}\n",
       "<?xml version=\"1.0\"?>\n<opencv_storage>\n<!-- <a> -->\n<image_width>320</image_width>\n"
       "<image_height>240</image_height>\n<fisheye_model>1</fisheye_model>\n<camera_matrix "
       "type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <data>\n    295. 0. 159.5 0. 295. 119.5\n    0. 0. "
       "1.</data></camera_matrix>\n<distortion_coefficients><data>0.1 -0.05\n 0.02 "
       "-0.01</data></distortion_coefficients>\n</opencv_storage>\n",
       "EquiDistant 295 295 159.5 119.5 0.1 -0.05 0.02 -0.01\n320 240\ncrop\n320 240\n"});
}

TEST(CalibrationFormats, OfOneLensIsTheSameCameraInEveryFormat) {
  ExpectAll(
      RadTan(),
      {kFlat + "Camera.model: perspective\nCamera.k1: 0.1\nCamera.k2: -0.05\nCamera.p1: 0.001\nCamera.p2: "
               "-0.002\nCamera.k3: 0\nCamera.cols: 320\nCamera.rows: 240\n",
       "model_type: PINHOLE\nimage_width: 320\nimage_height: 240\ndistortion_parameters: {k1: 0.1, k2: "
       "-0.05, "
       "p1: 0.001, p2: -0.002}\nprojection_parameters: {fx: 295, fy: 295, cx: 159.5, cy: 119.5}\n",
       "image_width: 320\nimage_height: 240\ncamera_matrix: [[295, 0, 159.5], [0, 295, 119.5], [0, 0, 1]]\n"
       "dist_coeff: [[0.1, -0.05, 0.001, -0.002, 0]]\n",
       "width: 320\nheight: 240\ndistortion_model: rational_polynomial\nd: [0.1, -0.05, 0.001, -0.002, 0, 0, "
       "0, 0]\nk: [295, 0, 159.5, 0, 295, 119.5, 0, 0, 1]\nbinning_x: 0\n---\nwidth: 5\n",
       "1 FULL_OPENCV 320 240 295 295 160 120 0.1 -0.05 0.001 -0.002 0 0 0 0\n",
       R"({"camera_type": "pinhole-radtan8", "intrinsics": {"fx": 295, "fy": 295, "cx": 159.5, "cy": 119.5,
          "k1": 0.1, "k2": -0.05, "p1": 0.001, "p2": -0.002, "k3": 0, "k4": 0, "k5": 0, "k6": 0},
          "resolution": [320, 240]})",
       "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, 0.1,\n         0.0, 1.0, "
       "0.0, "
       "0.2,\n         0.0, 0.0, 1.0, 0.3,\n         0.0, 0.0, 0.0, 1.0]\nrate_hz: 20\nresolution: [320, "
       "240]\n"
       "camera_model: pinhole\nintrinsics: [295, 295, 159.5, 119.5] #fu, fv, cu, cv\ndistortion_model: "
       "radial-tangential\ndistortion_coefficients: [0.1, -0.05, 0.001, -0.002]\n",
       "cameras:\n- {T_SC: [1], image_dimension: [320, 240], distortion_coefficients: [0.1, -0.05, 0.001, "
       "-0.002], distortion_type: radialtangential, focal_length: [295, 295], principal_point: [159.5, "
       "119.5]}\n",
       R"({"color": {"width": 320, "height": 240, "fx": 295, "fy": 295, "ppx": 159.5, "ppy": 119.5,
          "model": "distortion.brown_conrady", "coeffs": [0.1, -0.05, 0.001, -0.002, 0]}})"});
  PinholeCamera radial = RadTan();
  radial.coefficients = {0.1, 0, 0, 0, 0};
  ExpectAll(radial, {"2 SIMPLE_RADIAL 320 240 295 160 120 0.1\n3 PINHOLE 5 5 1 1 1 1\n",
                     "Width: 320\nHeight: 240\nPPX: 159.5\nPPY: 119.5\nFx: 295\nFy: 295\n"
                     "Distortion: Modified Brown Conrady\nCoeffs: 0.1 0 0 0 0\n"});
}

TEST(CalibrationFormats, OfAPinholeIsTheSameCameraInEveryFormat) {
  const std::string realsense =
      "width: 320\nheight: 240\nfx: 295\nfy: 295\nppx: 159.5\nppy: 119.5\nmodel: inverse_brown_conrady\n";
  ExpectAll(
      Plain(),
      {R"({"width": 320, "height": 240, "intrinsic_matrix": [295, 0, 0, 0, 295, 0, 159.5, 119.5, 1]})",
       R"({"intrinsic": {"width": 320, "height": 240, "intrinsic_matrix": [295, 0, 0, 0, 295, 0, 159.5, 119.5,
          1]}, "extrinsic": [1, 0, 0, 0]})",
       kFlat + "Camera.k1: 0.0\nCamera.cols: 320\nCamera.rows: 240\n",
       "image_width: 320\nimage_height: 240\ncamera_name: front\ncamera_matrix: " + kKMatrix +
           "distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, "
           "0]}\n",
       "camera:\n  width: 320\n  height: 240\n  fx: 295\n  fy: 295\n  cx: 159.5\n  cy: 119.5\n",
       realsense + "coeffs: [0, 0, 0, 0, 0]\n", "1 PINHOLE 320 240 295 295 160 120\n",
       R"({"camera": {"w": 320, "h": 240, "fx": 295, "fy": 295, "cx": 159.5, "cy": 119.5, "scale": 6553.5}})",
       "cam:\n  H: 240\n  W: 320\n  fx: 295\n  fy: 295\n  cx: 159.5\n  cy: 119.5\n  png_depth_scale: 5000\n",
       "%YAML:1.0\nd400_color_optical_frame:\n   sensor_name: d400_color\n   width: 320\n   height: 240\n"
       "   model: pinhole\n   intrinsics: !!opencv-matrix\n      rows: 1\n      cols: 4\n      dt: d\n"
       "      data: [ 295, 159.5, 295, 119.5 ]\n",
       "0.921875 1.22916666666666667 0.5 0.5 0\n320 240\nfull\n320 240\n"});
  PinholeCamera unsized = Plain();
  unsized.width = unsized.height = 0;
  ExpectAll(unsized,
            {"295 295 159.5 119.5\n", "295 0 159.5\n0 295 119.5\n0 0 1\n",
             "295, 0, 159.5\n0, 295, 119.5\n0, 0, 1\n", "295 0 159.5 0\n0 295 119.5 0\n0 0 1 0\n0 0 0 1\n",
             "P0: 295 0 159.5 0 0 295 119.5 0 0 0 1 0\nTr: 1 2 3\n"});
}

TEST(CalibrationFormats, OfACameraThatTuttiHasNotIsRefusedByItsName) {
  const std::string size = "image_width: 320\nimage_height: 240\n";
  const auto refused = [](const std::string& text, const std::string& why) {
    EXPECT_THAT(RefusalOfText(text), HasSubstr(why)) << text;
  };
  refused("Camera.model: equirectangular\nCamera.cols: 320\nCamera.rows: 160\n", "'equirectangular'");
  refused(kFlat + "Camera.model: radial_division\nCamera.distortion: -1e-7\n", "'radial_division'");
  refused(kFlat + "Camera.model: fisheye\nCamera.k1: 0.1\nCamera.p1: 0.1\n", "'p1' is not 0");
  refused("model_type: MEI\nmirror_parameters: {xi: 1.9}\n" + size, "'MEI'");
  refused(R"({"value0": {"intrinsics": [{"camera_type": "ds", "intrinsics": {"fx": 1, "xi": 0}}]}})", "'ds'");
  refused(R"({"value0": {"intrinsics": [{"camera_type": "fov", "intrinsics": {"fx": 295, "fy": 295, "cx": 160,
          "cy": 120, "w": 0.9}}], "resolution": [[320, 240]]}})",
          "'fov'");
  refused("1 FOV 320 240 295 295 160 120 0.9\n", "'FOV'");
  refused("1 THIN_PRISM_FISHEYE 320 240 295 295 160 120 0 0 0 0 0 0 0 0\n", "'THIN_PRISM_FISHEYE'");
  refused("1 OPENCV 320 240 295 295 160 120\n", "OPENCV has 4 parameters; 8 are needed");
  refused("295 295 159.5 119.5 0.9\n320 240\ncrop\n320 240\n", "'FOV'");
  refused(
      "width: 320\nheight: 240\nfx: 295\nfy: 295\nppx: 159.5\nppy: 119.5\nmodel: inverse_brown_conrady\n"
      "coeffs: [0.1, 0, 0, 0, 0]\n",
      "'inverse_brown_conrady'");
  refused(
      size + "camera_matrix: " + kKMatrix +
          "distortion_model: rational_polynomial\ndistortion_coefficients: [0.1, 0, 0, 0, 0, 0, 0.3, 0]\n",
      "'rational_polynomial' has more than 5 coefficients: number 7 is not 0");
  refused(size + "camera_matrix: " + kKMatrix + "distortion_model: equidistant\n", "has 0 coefficients");
  refused("camera_matrix: [295, 0.5, 159.5, 0, 295, 119.5, 0, 0, 1]\n", "is no camera matrix that tutti has");
  refused(R"({"camera_angle_x": 0.7, "frames": []})", "not the image width (w)");
  refused(R"({"frames": [{"fl_x": 5}, {"fl_x": 6}]})", "another 'fl_x' than the first one");
  refused("image_width: 320\nfx: 295\nfy: 295\ncx: 160\ncy: 120\n", "an image width, but no height");
  refused("<opencv_storage>\n</opencv_storage>\n", "holds no keys");
  refused("<opencv_storage>\n<camera_matrix><data>1 2 3 4 5</data></camera_matrix></opencv_storage>\n",
          "has 5 values");
  refused("295 295 159.5\n", "has 3 numbers");
}

TEST(CalibrationFormats, WithAFisheyeOfNoTermsIsNoPinhole) {
  const Calibration c = ReadText("image_width: 320\nimage_height: 240\ncamera_matrix: " + kKMatrix +
                                 "distortion_model: equidistant\ndistortion_coefficients: [0, 0, 0, 0]\n");
  EXPECT_EQ(c.camera.distortion, Distortion::kEquidistant);
}

TEST(CalibrationFormats, OfOpenCvHasFiveTerms) {
  const Calibration c =
      ReadText("%YAML:1.0\n---\n" + kKOfOpenCv +
               "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
               "   data: [ 0.2, -0.4, 0.001, 0.002, 0.1 ]\n");
  EXPECT_EQ(c.camera.coefficients, (DistortionCoefficients{0.2, -0.4, 0.001, 0.002, 0.1}));
}

TEST(CalibrationFormats, AreNamed) {
  for (const auto& [text, name] :
       {std::pair(kFlat, "ORB-SLAM"),
        {kFlat + "Camera.model: perspective\n", "OpenVSLAM"},
        {kKOfOpenCv, "OpenCV"},
        {"intrinsics: [295, 295, 159.5, 119.5]\n", "EuRoC"},
        {"camera: {width: 320, height: 240, fx: 295, fy: 295, cx: 159.5, cy: 119.5}\n", "tutti"},
        {"camera_name: front\ncamera_matrix: " + kKMatrix, "ROS"}})
    EXPECT_EQ(ReadText(text).format, name);
}

TEST(CalibrationFormats, WithSeveralCamerasSaysWhichItTook) {
  EXPECT_EQ(ReadText("2 PINHOLE 320 240 295 295 160 120\n3 PINHOLE 5 5 1 1 1 1\n").format,
            "COLMAP, camera 2, the first of 2");
  const std::string camera = "{fx: 295, fy: 295, ppx: 159.5, ppy: 119.5}\n";
  EXPECT_EQ(ReadText("color: " + camera + "depth: " + camera).format,
            "RealSense, color, the first of 2 cameras");
  EXPECT_THAT(ReadText("camera_matrix: " + kKMatrix + "distortion_coefficients: [0.1, 0, 0, 0]\n").format,
              HasSubstr("radtan, as the file names no lens"));
}

TEST(CalibrationFormats, WithBinningAndARegionIsOfTheImagesThatAreSent) {
  const Calibration c = ReadText(
      "width: 640\nheight: 480\nD: []\nK: [590, 0, 319.5, 0, 590, 239.5, 0, 0, 1]\nbinning_x: 2\nbinning_y: "
      "2\n"
      "roi: {x_offset: 20, y_offset: 40, height: 400, width: 600, do_rectify: false}\n");
  EXPECT_EQ(CameraAsText(c.camera), "300x200 295 295 149.5 99.5 lens 0 0 0 0 0 0");
  EXPECT_EQ(c.format, "ROS, binning 2x2, region 600x400 at (20, 40) applied");
  EXPECT_THAT(RefusalOfText("width: 640\nheight: 480\nK: [590, 0, 319.5, 0, 590, 239.5, 0, 0, 1]\n"
                            "roi: {x_offset: 100, y_offset: 0, height: 480, width: 600}\n"),
              HasSubstr("does not lie in the 640x480 pixels"));
}

TEST(CalibrationFormats, HasTheScaleOfDepthAndTheBaseline) {
  EXPECT_EQ(ReadText(R"({"camera": {"w": 320, "h": 240, "fx": 295, "fy": 295, "cx": 159.5, "cy": 119.5,
                   "scale": 6553.5}})")
                .depth_units_per_m,
            6553.5);
  EXPECT_EQ(ReadText("fx: 295\nfy: 295\nppx: 159.5\nppy: 119.5\ndepth_scale: 0.001\n").depth_units_per_m,
            1000);
  EXPECT_EQ(ReadText(kFlat + "depthmap_factor: 5000\n").depth_units_per_m, 5000);
  EXPECT_EQ(ReadText(kFlat + "Camera.focal_x_baseline: 29.5\n").baseline_m, 0.1);
  EXPECT_EQ(ReadText(kFlat + "Camera.bf: 29.5\n").baseline_m, 0.1);
  EXPECT_EQ(
      ReadText("camera: {width: 320, height: 240, fx: 295, fy: 295, cx: 159.5, cy: 119.5, baseline_m: 0.1}\n")
          .baseline_m,
      0.1);
  EXPECT_EQ(ReadText("intrinsics: [295, 295, 159.5, 119.5]\nrate_hz: 20\n").rate_hz, 20);
  EXPECT_NEAR(
      ReadText("P0: 295 0 159.5 0 0 295 119.5 0 0 0 1 0\nP1: 295 0 159.5 -29.5 0 295 119.5 0 0 0 1 0\n")
          .baseline_m,
      0.1, 1e-12);
}

// Rectified by opposite turns about y; 0.1 m apart.
const std::string kLeftR = "[0.8, 0, 0.6, 0, 1, 0, -0.6, 0, 0.8]\n";
const std::string kRightR = "[0.8, 0, -0.6, 0, 1, 0, 0.6, 0, 0.8]\n";
std::string OrbSlam2Pair(const std::string& R_right) {
  const std::string K = "{rows: 3, cols: 3, dt: d, data:[590, 0, 150, 0, 591, 120, 0, 0, 1]}\n";
  return kFlat + "Camera.bf: 29.5\nLEFT.width: 320\nLEFT.height: 240\nLEFT.K: " + K +
         "LEFT.D: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data:[0.1, 0, 0, 0, 0]\nLEFT.R: " +
         kLeftR + "RIGHT.K: " + K + "RIGHT.D: [0.2, 0, 0, 0, 0]\nRIGHT.width: 320\nRIGHT.height: 240\n" +
         R_right;
}

TEST(CalibrationFormats, TellsHowTheImuIsMountedAndItsClock) {
  const TransformRows wanted = {0.28, 0, 0.96, -0.08, 0, 1, 0, 0, -0.96, 0, 0.28, 0.06, 0, 0, 0, 1};
  const std::string rows = "[[0.28, 0, 0.96, -0.08], [0, 1, 0, 0], [-0.96, 0, 0.28, 0.06], [0, 0, 0, 1]]";
  const std::string inverse = "[0.28, 0, -0.96, 0.08, 0, 1, 0, 0, 0.96, 0, 0.28, 0.06, 0, 0, 0, 1]";
  const std::string cam = "intrinsics: [590, 591, 150, 120], resolution: [320, 240]}\n";
  const std::string slam = "Camera.fx: 590\nCamera.fy: 591\nCamera.cx: 150\nCamera.cy: 120\n";
  for (const std::string& file :
       {"cam0: {T_cam_imu: " + rows + ", timeshift_cam_imu: 0.02, " + cam,
        "cam0: {T_imu_cam: " + inverse + ", timeshift_cam_imu: 0.02, " + cam, slam + "IMU.T_b_c1: " + inverse,
        slam + "Tbc: {rows: 4, cols: 4, dt: f, data: " + inverse + "}\n",
        std::string(
            R"({"value0": {"cam_time_offset_ns": 20000000, "T_imu_cam": [{"px": 0.08, "py": 0, "pz": 0.06,
           "qx": 0, "qy": -0.6, "qz": 0, "qw": 0.8}], "intrinsics": [{"camera_type": "pinhole", "intrinsics":
           {"fx": 590, "fy": 591, "cx": 150, "cy": 120}}], "resolution": [[320, 240]]}})")}) {
    const Calibration c = ReadText(file);
    for (std::size_t i = 0; i < 16; ++i) EXPECT_NEAR(c.T_camera_imu[i], wanted[i], 1e-9) << i << file;
    EXPECT_NEAR(c.imu_offset_s, file.find("Camera.fx") == std::string::npos ? -0.02 : 0, 1e-12) << file;
  }
  EXPECT_EQ(ReadText("cam0: {" + cam).T_camera_imu, TransformRows{});
}

TEST(CalibrationFormats, OfRawPairsGivesTheRightCameraInEveryFormat) {
  // p_right = R_right^T (R_left p_left - baseline e_x)
  const TransformRows wanted = {0.28, 0, 0.96, -0.08, 0, 1, 0, 0, -0.96, 0, 0.28, 0.06, 0, 0, 0, 1};
  const std::string rows = "[[0.28, 0, 0.96, -0.08], [0, 1, 0, 0], [-0.96, 0, 0.28, 0.06], [0, 0, 0, 1]]";
  const std::string unit = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";
  const std::string cam = ", intrinsics: [590, 591, 150, 120], resolution: [320, 240]}\n";
  const std::string K = "[590, 0, 150, 0, 591, 120, 0, 0, 1]\n", D = "[0.1, 0, 0, 0, 0]\n";
  const std::string rectifier = "  K_left: " + K + "  D_left: " + D + "  R_left: " + kLeftR +
                                "  K_right: " + K + "  D_right: " + D + "  R_right: " + kRightR;
  for (const std::string& file :
       {OrbSlam2Pair("RIGHT.R: " + kRightR),
        "Camera: {model: perspective, fx: 295, fy: 295, cx: 160, cy: 120, cols: 320, rows: 240, "
        "focal_x_baseline: 29.5}\nStereoRectifier:\n" +
            rectifier,
        "cam0: {T_cam_imu: " + unit + cam + "cam1: {T_cam_imu: " + rows + cam,
        "cam0: {T_imu_cam: " + rows + cam + "cam1: {T_imu_cam: " + unit + cam,
        "image_width: 320\nimage_height: 240\nM1: " + K + "D1: " + D + "M2: " + K + "D2: " + D +
            "R: [0.28, 0, 0.96, 0, 1, 0, -0.96, 0, 0.28]\nT: [-0.08, 0, 0.06]\n",
        std::string(
            R"({"value0": {"T_imu_cam": [{"px": -0.08, "py": 0, "pz": 0.06, "qx": 0, "qy": 0.6, "qz": 0,
           "qw": 0.8}, {"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}], "intrinsics": [)") +
            R"({"camera_type": "pinhole", "intrinsics": {"fx": 590, "fy": 591, "cx": 150, "cy": 120}},
               {"camera_type": "pinhole", "intrinsics": {"fx": 590, "fy": 591, "cx": 150, "cy": 120}}],
               "resolution": [[320, 240], [320, 240]]}})"}) {
    const Calibration c = ReadText(file, true);
    EXPECT_EQ(c.camera.fy, 591) << file;
    EXPECT_EQ(c.camera.width, 320) << file;
    ASSERT_TRUE(c.right) << file;
    EXPECT_EQ(c.right->fx, 590) << file;
    EXPECT_EQ(c.baseline_m, 0) << file;
    for (std::size_t i = 0; i < 16; ++i) EXPECT_NEAR(c.T_right_left[i], wanted[i], 1e-9) << i << file;
  }
  EXPECT_EQ(ReadText(OrbSlam2Pair("RIGHT.R: " + kRightR), true).right->coefficients[0], 0.2);
}

TEST(CalibrationFormats, OfRawPairsNeedsTheirRectification) {
  const Calibration one = ReadText(OrbSlam2Pair(""));
  EXPECT_EQ(one.camera.fx, 590) << "the images are raw, Camera.fx is of rectified ones";
  EXPECT_EQ(one.camera.coefficients[0], 0.1);
  EXPECT_THAT(RefusalOfText(OrbSlam2Pair(""), true), HasSubstr("has no key 'RIGHT.R'"));
  EXPECT_THAT(RefusalOfText(OrbSlam2Pair("RIGHT.R: [2, 0, 0, 0, 1, 0, 0, 0, 1]\n"), true),
              HasSubstr("is no rotation"));
}

TEST(CalibrationFormats, OfVinsMayNameTheFilesOfItsCameras) {
  const fs::path folder = testing::FreshFolder();
  const std::string camera =
      "%YAML:1.0\n---\nmodel_type: PINHOLE\nimage_width: 320\nimage_height: 240\nprojection_parameters: {fx: "
      "295, fy: 295, cx: 159.5, cy: 119.5}\n";
  std::ofstream(folder / "left.yaml") << camera;
  std::ofstream(folder / "right.yaml") << camera;
  const std::string rest = ", 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}\n";
  std::ofstream(folder / "vins.yaml")
      << "%YAML:1.0\ncam0_calib: \"left.yaml\"\ncam1_calib: \"right.yaml\"\n"
      << "body_T_cam0: !!opencv-matrix {rows: 4, cols: 4, dt: d, data: [1, 0, 0, 0" << rest
      << "body_T_cam1: {data: [1, 0, 0, 0.1" << rest;
  const Calibration c = ReadCalibration(folder / "vins.yaml", true);
  EXPECT_EQ(CameraAsText(c.camera), CameraAsText(Plain()));
  ASSERT_TRUE(c.right);
  EXPECT_NEAR(c.T_right_left[3], -0.1, 1e-12);
}

}  // namespace
}  // namespace tutti
