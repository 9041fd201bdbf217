// Layouts of public data sets and recorders: small folders whose frames, depth and poses are known.
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>

#include "frontend/dataset/image_file.h"
#include "frontend/dataset/layout.h"
#include "gmock/gmock.h"
#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains, ::testing::HasSubstr, ::testing::Not;
using testing::Difference, testing::FreshFolder, testing::OpenError, testing::Picture, testing::With,
    testing::WriteImage, testing::WriteText;

std::string Number(int i, int digits = 6) {
  const std::string text = std::to_string(i);
  return std::string(static_cast<std::size_t>(digits) - text.size(), '0') + text;
}

std::string Named(std::string pattern, int i) { return pattern.replace(pattern.find('#'), 1, Number(i, 4)); }

cv::Mat Depth(int value, cv::Size size = {64, 48}) { return {size, CV_16UC1, cv::Scalar(value)}; }

std::string Npy(const std::string& type, const std::string& shape, std::size_t bytes,
                const std::string& order = "False") {
  std::string header =
      "{'descr': '" + type + "', 'fortran_order': " + order + ", 'shape': (" + shape + "), }";
  header.resize((10 + header.size() + 64) / 64 * 64 - 11, ' ');
  header += '\n';
  std::string file("\x93NUMPY\x01\x00", 8);
  file += static_cast<char>(header.size() % 256);
  file += static_cast<char>(header.size() / 256);
  return file + header + std::string(bytes, '\0');
}

void WriteNpy(const fs::path& file, cv::Size size, float value) {
  const std::size_t bytes = 4 * static_cast<std::size_t>(size.area());
  std::string text = Npy("<f4", std::to_string(size.height) + ", " + std::to_string(size.width), bytes);
  for (std::size_t at = text.size() - bytes; at < text.size(); at += 4) std::memcpy(&text[at], &value, 4);
  WriteText(file, text);
}

// A pose without a turn, as a matrix of 4x4.
std::string MatrixText(int x, int y, int z) {
  return "1 0 0 " + std::to_string(x) + "\n0 1 0 " + std::to_string(y) + "\n0 0 1 " + std::to_string(z) +
         "\n0 0 0 1\n";
}

DatasetOptions TenCentimetrePair() {
  DatasetOptions options = With(Sensor::kStereo, true);
  options.baseline_m = 0.1;
  return options;
}

// The camera's motion from the first pose of the ground truth to the last one, in the first one's frame.
Pose CameraMotion(const Dataset& data) {
  const Trajectory truth = data.ReadGroundTruth(data.GroundTruthFile().value(), nullptr);
  const Pose T_body_camera = data.Rig().T_body_camera;
  return (truth.front().pose * T_body_camera).Inverse() * (truth.back().pose * T_body_camera);
}

void ExpectLayoutMotion(const Dataset& data, const Eigen::Vector3d& translation) {
  const Pose motion = CameraMotion(data);
  EXPECT_LT((motion.translation - translation).norm(), 1e-6) << motion.translation.transpose();
  EXPECT_LT(motion.Angle(), 1e-6);
}

float DepthAt(const Dataset& data, std::size_t i, int v = 24, int u = 32) {
  const ReadResult read = data.Read(i);
  EXPECT_TRUE(read.frame) << read.error;
  EXPECT_EQ(read.depth_error, "");
  if (!read.frame || read.frame->depth_m.empty()) return -1;
  return read.frame->depth_m.at<float>(v, u);
}

TEST(DatasetLayouts, TartanAirHasItsPublishedCameraFloatDepthAndPosesThatLookAlongX) {
  const fs::path folder = FreshFolder();
  for (int i = 0; i < 3; ++i) {
    const cv::Mat image = Picture(640, 480, i);
    WriteImage(folder / "image_left" / (Number(i) + "_left.png"), image);
    WriteImage(folder / "image_right" / (Number(i) + "_right.png"), image);
    WriteNpy(folder / "depth_left" / (Number(i) + "_left_depth.npy"), {640, 480},
             2.5F + static_cast<float>(i));
  }
  // It looks to the east and drives there: yaw of 90 deg about "down".
  const std::string east = " -1 0 0 0.7071067811865476 0.7071067811865476\n";
  WriteText(folder / "pose_left.txt", "0 0" + east + "0 1" + east + "0 2" + east);
  EXPECT_EQ(FindLayout(folder)->Text(), "TartanAir (image_left, image_right, depth_left)");
  const auto stereo = OpenDataset(folder, With(Sensor::kStereo));
  EXPECT_EQ(stereo->Rig().camera.fx, 320);
  EXPECT_EQ(stereo->Rig().baseline_m, 0.25);
  EXPECT_FALSE(stereo->Read(2).frame->right.empty());
  const auto rgbd = OpenDataset(folder, With(Sensor::kRgbd));
  EXPECT_EQ(DepthAt(*rgbd, 1), 3.5F);
  EXPECT_THAT(rgbd->Warnings(), Not(Contains(HasSubstr("unit"))));
  ExpectLayoutMotion(*rgbd, {0, 0, 2});  // forward
  WriteText(folder / "pose_left.txt", "0 0 0 0 0 0 1\n");
  const auto less = OpenDataset(folder, With(Sensor::kMono));
  EXPECT_THROW(less->ReadGroundTruth(folder / "pose_left.txt", nullptr), InputError);
}

TEST(DatasetLayouts, TheSecondTartanAirHasFloatsInTheBytesOfPngs) {
  const fs::path folder = FreshFolder();
  const float metres = 7.25F;
  for (int i = 0; i < 2; ++i) {
    WriteImage(folder / "image_lcam_front" / (Number(i) + "_lcam_front.png"), Picture(640, 640, i));
    cv::Mat depth(640, 640, CV_8UC4);
    for (int k = 0; k < 640 * 640; ++k) std::memcpy(depth.data + 4 * k, &metres, 4);
    WriteImage(folder / "depth_lcam_front" / (Number(i) + "_lcam_front_depth.png"), depth);
  }
  EXPECT_EQ(DepthAt(*OpenDataset(folder, With(Sensor::kRgbd)), 1), metres);
}

// A drive of 10 m to the north, turned to the north, with the axes of the vehicle in the laser scanner.
fs::path KittiRaw(const fs::path& day, cv::Size size) {
  const fs::path drive = day / "2011_09_26_drive_0001_sync";
  std::string times;
  for (int i = 0; i < 3; ++i) {
    for (const char* camera : {"image_00", "image_01"})
      WriteImage(drive / camera / "data" / (Number(i, 10) + ".png"), Picture(size.width, size.height, i));
    times += "2011-09-26 13:02:2" + std::to_string(i) + ".500000000\n";
    const double north = 49 + i * (5 / 6378137.0) * 180 / M_PI;
    char oxts[200];
    std::snprintf(oxts, sizeof oxts,
                  "%.12f 8.4 110 0 0 %.12f 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 4 9 6 6 6\n", north,
                  M_PI / 2);
    WriteText(drive / "oxts" / "data" / (Number(i, 10) + ".txt"), oxts);
  }
  WriteText(drive / "image_00" / "timestamps.txt", times);
  WriteText(drive / "oxts" / "timestamps.txt", times);
  const std::string one = "1 0 0 0 1 0 0 0 1\n", none = "0 0 0\n";
  WriteText(day / "calib_imu_to_velo.txt", "calib_time: 25-May-2012 16:47:16\nR: " + one + "T: " + none);
  WriteText(day / "calib_velo_to_cam.txt", "R: 0 -1 0 0 0 -1 1 0 0\nT: 0 0 -0.5\n");
  std::string cameras = "calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.950000e-02\n";
  for (const auto& [name, t] : {std::pair("00", "0"), {"01", "-0.5"}}) {
    const std::string n = name;
    cameras += "S_" + n + ": 80 60\nK_" + n + ": 110 0 40 0 110 30 0 0 1\nD_" + n + ": -0.1 0.01 0 0 0\nR_" +
               n + ": " + one + "T_" + n + ": " + t + " 0 0\nS_rect_" + n + ": 64 48\nR_rect_" + n + ": " +
               one + "P_rect_" + n + ": 100 0 32 " + (n == "01" ? "-50" : "0") + " 0 100 24 0 0 0 1 0\n";
  }
  WriteText(day / "calib_cam_to_cam.txt", cameras);
  return drive;
}

TEST(DatasetLayouts, KittiRawHasTheDaysCalibrationAndTheGroundTruthOfItsGps) {
  const fs::path drive = KittiRaw(FreshFolder() / "2011_09_26", {64, 48});
  const auto data = OpenDataset(drive, With(Sensor::kStereo));
  ASSERT_EQ(data->Size(), 3U);
  EXPECT_EQ(data->Rig().camera.fx, 100);
  EXPECT_DOUBLE_EQ(data->Rig().baseline_m, 0.5);
  EXPECT_DOUBLE_EQ(data->Stamp(1), 1317042141.5);  // date -u -d "2011-09-26 13:02:21.5" +%s.%N
  const Pose motion = CameraMotion(*data);
  EXPECT_NEAR(motion.translation.z(), 10, 1e-4);
  EXPECT_NEAR(motion.translation.x(), 0, 1e-6);
  EXPECT_LT(motion.Angle(), 1e-9);
  EXPECT_NEAR((data->Rig().T_body_camera.translation - Eigen::Vector3d(0.5, 0, 0)).norm(), 0, 1e-9);
}

TEST(DatasetLayouts, KittiRawOfImagesThatAreNotRectifiedIsRectified) {
  const fs::path drive = KittiRaw(FreshFolder() / "2011_09_26", {80, 60});
  const auto data = OpenDataset(drive, With(Sensor::kStereo));
  EXPECT_NEAR(data->Rig().baseline_m, 0.5, 1e-9);
  EXPECT_EQ(data->Rig().camera.width, 80);
  EXPECT_EQ(data->Rig().camera.distortion, Distortion::kNone);
}

TEST(DatasetLayouts, ScanNetSkipsLostPosesAndLooksUpDepthOfAnotherSize) {
  const fs::path folder = FreshFolder();
  for (int i = 0; i < 12; ++i) {  // 10.jpg comes after 9.jpg
    WriteImage(folder / "color" / (std::to_string(i) + ".jpg"), Picture(128, 96, i));
    cv::Mat depth = Depth(1000 + i, {64, 48});
    depth.col(10) = 3000;
    WriteImage(folder / "depth" / (std::to_string(i) + ".png"), depth);
    const std::string lost = "-inf -inf -inf -inf\n";
    WriteText(folder / "pose" / (std::to_string(i) + ".txt"),
              i == 3 ? lost + lost + lost + lost : MatrixText(0, 0, i));
  }
  WriteText(folder / "intrinsic" / "intrinsic_color.txt", "120 0 64 0\n0 120 48 0\n0 0 1 0\n0 0 0 1\n");
  WriteText(folder / "intrinsic" / "intrinsic_depth.txt", "60 0 32 0\n0 60 24 0\n0 0 1 0\n0 0 0 1\n");
  const auto data = OpenDataset(folder, With(Sensor::kRgbd));
  EXPECT_EQ(data->Rig().camera.fx, 120);
  EXPECT_FLOAT_EQ(DepthAt(*data, 11), 1.011F);
  EXPECT_FLOAT_EQ(DepthAt(*data, 11, 50, 20), 3);  // column 10 of the depth image
  EXPECT_NEAR(data->Stamp(11), 11.0 / 30, 1e-9);
  const Trajectory truth = data->ReadGroundTruth(data->GroundTruthFile().value(), nullptr);
  ASSERT_EQ(truth.size(), 11U);
  EXPECT_NEAR(truth[3].stamp_s, 4.0 / 30, 1e-9);
  ExpectLayoutMotion(*data, {0, 0, 11});
  WriteText(folder / "pose" / "5.txt", "1 0 0 0\n0 1 0 0\n");
  EXPECT_THROW(data->ReadGroundTruth(folder / "pose", nullptr), InputError);
}

TEST(DatasetLayouts, SevenScenesIsRgbdInMillimetresWithAPoseBesideEachImage) {
  const fs::path folder = FreshFolder();
  for (int i = 0; i < 4; ++i) {
    const std::string name = "frame-" + Number(2 * i);  // every second frame
    WriteImage(folder / (name + ".color.png"), Picture(64, 48, i));
    cv::Mat depth = Depth(1500);
    depth.row(0) = 65535;  // none
    WriteImage(folder / (name + ".depth.png"), depth);
    WriteText(folder / (name + ".pose.txt"), MatrixText(i, 0, 0));
  }
  const auto data = OpenDataset(folder, With(Sensor::kRgbd, true));
  ASSERT_EQ(data->Size(), 4U);
  EXPECT_FLOAT_EQ(DepthAt(*data, 3), 1.5F);
  EXPECT_EQ(DepthAt(*data, 3, 0), 0);
  EXPECT_NEAR(data->Stamp(3), 6.0 / 30, 1e-9);
  EXPECT_EQ(Difference(data->Read(3).frame->image, Picture(64, 48, 3)), 0);
  ExpectLayoutMotion(*data, {3, 0, 0});
  EXPECT_EQ(OpenDataset(folder, With(Sensor::kMono))->Size(), 4U) << "depth images are no frames";
}

TEST(DatasetLayouts, ReplicaHasItsUnitOfDepthAndAPoseALineWhicheverFolderIsGiven) {
  const fs::path folder = FreshFolder() / "room0";
  std::string poses;
  for (int i = 0; i < 3; ++i) {
    WriteImage(folder / "results" / ("frame" + Number(i) + ".jpg"), Picture(64, 48, i));
    WriteImage(folder / "results" / ("depth" + Number(i) + ".png"), Depth(6554 * 2));
    poses += "1 0 0 0 0 1 0 " + std::to_string(i) + " 0 0 1 0 0 0 0 1\n";
  }
  WriteText(folder / "traj.txt", poses);
  for (const fs::path& given : {folder, folder / "results"}) {
    const auto data = OpenDataset(given, With(Sensor::kRgbd, true));
    EXPECT_NEAR(DepthAt(*data, 2), 2, 1e-3);
    ExpectLayoutMotion(*data, {0, 2, 0});
  }
}

TEST(DatasetLayouts, ColourAndDepthInOneFolderAreToldApartByTheirNames) {
  const std::vector<std::pair<const char*, const char*>> names = {
      {"#_color.png", "#_depth.png"},   {"#-color.jpg", "#-depth.png"}, {"color_#.png", "depth_#.png"},
      {"rgb_#.png", "depth_#.png"},     {"frame#.jpg", "depth#.png"},   {"#.rgb.png", "#.depth.png"},
      {"img_#.png", "img_#_depth.png"}, {"#.jpg", "#_depth.png"},       {"#.jpg", "#_depth.npy"},
      {"Color#.png", "Depth#.png"},
  };
  for (const auto& [colour, depth] : names) {
    const fs::path folder = FreshFolder() / "one";
    fs::remove_all(folder);
    for (int i = 0; i < 3; ++i) {
      WriteImage(folder / Named(colour, i), Picture(64, 48, i));
      if (std::string(depth).find("npy") != std::string::npos)
        WriteNpy(folder / Named(depth, i), {64, 48}, 2);
      else
        WriteImage(folder / Named(depth, i), Depth(10000));
    }
    EXPECT_EQ(DetectDatasetType(folder), DatasetType::kPaired) << colour;
    const auto data = OpenDataset(folder, With(Sensor::kRgbd, true));
    ASSERT_EQ(data->Size(), 3U) << colour;
    EXPECT_EQ(DepthAt(*data, 2), 2) << colour;
    EXPECT_EQ(FramesIn(folder, false, nullptr).size(), 3U) << colour;
  }
}

TEST(DatasetLayouts, LeftAndRightImagesArePairsByNumberInOneFolderOrTwo) {
  const std::vector<std::pair<const char*, const char*>> names = {
      {"left_#.png", "right_#.png"},   {"#_left.png", "#_right.png"},
      {"#_L.png", "#_R.png"},          {"left/#.png", "right/#.png"},
      {"cam0/#.png", "cam1/#.png"},    {"image_left/#.png", "image_right/#.png"},
      {"infra1/#.png", "infra2/#.png"}};
  for (const auto& [left, right] : names) {
    const fs::path folder = FreshFolder() / "two";
    fs::remove_all(folder);
    for (int i = 0; i < 4; ++i) {
      WriteImage(folder / Named(left, i), Picture(64, 48, i));
      if (i != 1) WriteImage(folder / Named(right, i), Picture(64, 48, i + 100));
    }
    const auto data = OpenDataset(folder, TenCentimetrePair());
    ASSERT_EQ(data->Size(), 4U) << left;
    EXPECT_TRUE(data->Read(1).frame->right.empty());
    EXPECT_EQ(Difference(data->Read(2).frame->right, Picture(64, 48, 102)), 0) << left;
    EXPECT_THAT(data->Warnings(), Contains(HasSubstr("1 of 4 images have no right image")));
  }
}

TEST(DatasetLayouts, AFolderOfKalibrsBagExtractorHasItsNanosecondsAndPairs) {
  const fs::path folder = FreshFolder();
  for (int i = 0; i < 3; ++i) {
    const std::string second = std::to_string(1403636579 + i);
    WriteImage(folder / "cam0" / (second + "763555584.png"), Picture(64, 48, i));
    WriteImage(folder / "cam1" / (second + "763600000.png"), Picture(64, 48, i + 100));  // 44 us later
  }
  WriteText(folder / "imu0.csv", "timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z\n");
  const auto data = OpenDataset(folder, TenCentimetrePair());
  EXPECT_NEAR(data->Stamp(1), 1403636580.763555584, 1e-6);
  EXPECT_EQ(Difference(data->Read(2).frame->right, Picture(64, 48, 102)), 0);
}

TEST(DatasetLayouts, Open3DsDepthIsInMillimetresAndItsTrajectoryLogIsRead) {
  const fs::path folder = FreshFolder();
  std::string log;
  for (int i = 0; i < 3; ++i) {
    WriteImage(folder / "color" / (Number(i) + ".jpg"), Picture(64, 48, i));
    WriteImage(folder / "depth" / (Number(i) + ".png"), Depth(2000));
    log += "0 0 " + std::to_string(i) + "\n" + MatrixText(0, 0, 2 * i);
  }
  WriteText(folder / "trajectory.log", log);
  const auto data = OpenDataset(folder, With(Sensor::kRgbd, true));
  EXPECT_EQ(DepthAt(*data, 1), 2);
  ExpectLayoutMotion(*data, {0, 0, 4});
  WriteText(folder / "trajectory.log", log + "0 0\n");
  EXPECT_THROW(data->ReadGroundTruth(folder / "trajectory.log", nullptr), InputError);
}

TEST(DatasetLayouts, OpenLorisHasMillimetresItsOwnCalibrationAndPosesOfTheRobot) {
  const fs::path folder = FreshFolder();
  std::string colour, depth;
  for (int i = 0; i < 3; ++i) {
    const std::string name = "156000000" + std::to_string(i) + ".png";
    WriteImage(folder / "color" / name, Picture(64, 48, i));
    WriteImage(folder / "aligned_depth" / name, Depth(2000));
    WriteImage(folder / "depth" / name, Depth(9999));  // not registered
    colour += "156000000" + std::to_string(i) + ".0 color/" + name + "\n";
    depth += "156000000" + std::to_string(i) + ".0 aligned_depth/" + name + "\n";
  }
  WriteText(folder / "color.txt", colour);
  WriteText(folder / "aligned_depth.txt", depth);
  WriteText(folder / "depth.txt", depth);
  WriteText(folder / "groundtruth.txt",
            "#Time px py pz qx qy qz qw\n1560000000.0 0 0 0 0 0 0 1\n1560000002.0 3 0 0 0 0 0 1\n");
  const auto link = [](const char* parent, const char* child, const char* data) {
    return std::string("   -\n      parent_frame: ") + parent + "\n      child_frame: " + child +
           "\n      matrix: !!opencv-matrix\n         rows: 4\n         cols: 4\n         dt: d\n         "
           "data: [ " +
           data + " ]\n";
  };
  WriteText(
      folder / "sensors.yaml",
      "%YAML:1.0\nd400_color_optical_frame:\n   width: 64\n   height: 48\n   intrinsics: !!opencv-matrix\n"
      "      rows: 1\n      cols: 4\n      dt: d\n      data: [ 61., 32.5, 62., 24.5 ]\n");
  WriteText(
      folder / "trans_matrix.yaml",
      "%YAML:1.0\ntrans_matrix:\n" +
          link("base_link", "laser", "1., 0., 0., 0.2, 0., 1., 0., 0., 0., 0., 1., 0.1, 0., 0., 0., 1.") +
          link("laser", "d400_color_optical_frame",
               "0., 0., 1., 0.3, -1., 0., 0., 0., 0., -1., 0., 0.9, 0., 0., 0., 1."));
  const auto data = OpenDataset(folder, With(Sensor::kRgbd));
  EXPECT_EQ(data->Rig().camera.fx, 61);
  EXPECT_EQ(data->Rig().camera.cx, 32.5);
  EXPECT_EQ(data->Rig().camera.fy, 62);
  EXPECT_EQ(DepthAt(*data, 1), 2);
  EXPECT_LT((data->Rig().T_body_camera.translation - Eigen::Vector3d(0.5, 0, 1)).norm(), 1e-9);
  ExpectLayoutMotion(*data, {0, 0, 3});  // base_link's x is forward
  WriteText(folder / "trans_matrix.yaml", "%YAML:1.0\n---\ntrans_matrix: [ 1, ");
  EXPECT_THAT(OpenError(folder, With(Sensor::kRgbd)), HasSubstr("trans_matrix.yaml"));
}

fs::path TumFolder(const fs::path& folder, int depth) {
  std::string colour, list;
  for (int i = 0; i < 2; ++i) {
    const std::string name = std::to_string(i) + ".png";
    WriteImage(folder / "rgb" / name, Picture(64, 48, i));
    WriteImage(folder / "depth" / name, Depth(depth));
    colour += std::to_string(i) + ".0 rgb/" + name + "\n";
    list += std::to_string(i) + ".0 depth/" + name + "\n";
  }
  WriteText(folder / "rgb.txt", colour);
  WriteText(folder / "depth.txt", list);
  return folder;
}

TEST(DatasetLayouts, TheUnitOfDepthThatNothingSaysIsAssumedAndSaid) {
  const fs::path folder = TumFolder(FreshFolder(), 1500);
  DatasetOptions options = With(Sensor::kRgbd, true);
  const auto data = OpenDataset(folder, options);
  EXPECT_FLOAT_EQ(DepthAt(*data, 0), 0.3F);
  EXPECT_THAT(data->Warnings(), Contains(::testing::AllOf(HasSubstr("5000 a metre is assumed"),
                                                          HasSubstr("0.30 m (1.50 m in millimetres)"),
                                                          HasSubstr("depth_units_per_m=1000"))));
  options.depth_units_per_m = 1000;
  const auto said = OpenDataset(folder, options);
  EXPECT_FLOAT_EQ(DepthAt(*said, 0), 1.5F);
  EXPECT_THAT(said->Warnings(), Not(Contains(HasSubstr("assumed"))));
}

TEST(DatasetLayouts, Eth3dHasItsCalibrationAndUnit) {
  const fs::path folder = TumFolder(FreshFolder(), 10000);
  WriteText(folder / "calibration.txt", "70.5 71.5 31 23\n");
  const auto data = OpenDataset(folder, With(Sensor::kRgbd));
  EXPECT_EQ(data->Rig().camera.fy, 71.5);
  EXPECT_EQ(DepthAt(*data, 0), 2);
  EXPECT_THAT(data->Warnings(), Not(Contains(HasSubstr("assumed"))));
}

TEST(DatasetLayouts, StrayScannersVideoHasTheDepthAndTheTimesOfItsFrames) {
  const fs::path folder = FreshFolder();
  std::vector<cv::Mat> images;
  for (int i = 0; i < 5; ++i) images.push_back(Picture(128, 96, i));
  if (!testing::WriteMotionJpeg(folder / "rgb.avi", images, 30))
    GTEST_SKIP() << "this OpenCV can't write a video";
  fs::rename(folder / "rgb.avi", folder / "rgb.mp4");
  std::string odometry = "timestamp, frame, x, y, z, qx, qy, qz, qw\n";
  for (int i = 0; i < 5; ++i) {
    WriteImage(folder / "depth" / (Number(i) + ".png"), Depth(1000 + 100 * i, {32, 24}));
    WriteImage(folder / "confidence" / (Number(i) + ".png"), cv::Mat(24, 32, CV_8UC1, cv::Scalar(2)));
    if (i == 2) continue;  // a frame that has no line
    odometry += std::to_string(500.25 + 0.04 * i) + ", " + Number(i) + ", 0.0, 0.0, " + std::to_string(i) +
                ", 0.0, 0.0, 0.0, 1.0\n";
  }
  WriteText(folder / "odometry.csv", odometry);
  WriteText(folder / "camera_matrix.csv", "130.0, 0.0, 64.0\n0.0, 130.0, 48.0\n0.0, 0.0, 1.0\n");
  EXPECT_EQ(DetectDatasetType(folder), DatasetType::kPaired);
  const auto data = OpenDataset(folder, With(Sensor::kRgbd));
  ASSERT_EQ(data->Size(), 4U);
  EXPECT_EQ(data->Rig().camera.fx, 130);
  EXPECT_NEAR(data->Stamp(3), 500.41, 1e-9);
  EXPECT_FLOAT_EQ(DepthAt(*data, 2), 1.3F);
  EXPECT_EQ(data->Read(2).frame->depth_m.size(), cv::Size(128, 96));
  EXPECT_EQ(data->Read(2).frame->index, 2);
  ExpectLayoutMotion(*data, {0, 0, 4});
  EXPECT_THAT(OpenError(folder, With(Sensor::kStereo)), HasSubstr("one camera"));
}

TEST(DatasetLayouts, ArraysOfNumPyAreReadOnlyIfTheyHoldWhatTheySay) {
  const fs::path file = FreshFolder() / "depth.npy";
  const auto error = [&](const std::string& bytes) {
    WriteText(file, bytes);
    return ReadDepthFile(file).error;
  };
  for (const std::string& whole :
       {Npy("<f4", "2, 3", 24), Npy("<f2", "1, 2, 3", 12), Npy("<f8", "2, 3, 1", 48), Npy("<u2", "2, 3", 12)})
    EXPECT_EQ(error(whole), "");
  EXPECT_EQ(ReadDepthFile(file).image.type(), CV_16UC1);
  const std::pair<std::string, const char*> damaged[] = {
      {Npy("<f4", "2, 3", 23), "truncated"},
      {Npy("<f4", "99999, 99999", 24), "million"},
      {Npy("<f4", "9223372036854775807, 2", 24), "million"},
      {Npy("<f4", "-2, 3", 24), "shape"},
      {Npy("<f4", "6,", 24), "1 dimensions"},
      {Npy("<f4", "2, 3", 24, "True"), "C order"},
      {Npy("|O", "2, 3", 24), "'|O'"},
      {std::string("\x93NUMPY\x02\x00\xff\xff\xff\xff", 12), "damaged header"},
      {"\x93NUM", "no array"},
      {"", "no array"}};
  for (const auto& [bytes, message] : damaged) EXPECT_THAT(error(bytes), HasSubstr(message));
}

TEST(DatasetLayouts, TheFolderOfImagesInsideAConfiguredLayoutOpensThatLayout) {
  const fs::path kitti = FreshFolder() / "00";
  tutti::testing::MakeKitti(kitti, 4, true);
  DatasetOptions options = With(Sensor::kStereo);
  options.type = DatasetType::kKitti;
  const auto data = OpenDataset(kitti / "image_0", options);
  EXPECT_FALSE(data->Read(3).frame->right.empty());
  EXPECT_THAT(data->Warnings(), Contains(HasSubstr("is part of")));
  EXPECT_THAT(OpenError(kitti / "image_1", options), HasSubstr("left (or colour) images"));
  options = With(Sensor::kRgbd, true);
  options.type = DatasetType::kTum;
  const fs::path other = kitti.parent_path();
  EXPECT_EQ(OpenDataset(TumFolder(other / "desk", 5000) / "rgb", options)->Size(), 2U);
  options.sensor = Sensor::kMono;  // nothing but images
  WriteImage(other / "alone" / "1.png", Picture(64, 48, 1));
  EXPECT_THAT(OpenDataset(other / "alone", options)->Warnings(), Contains(HasSubstr("as a plain folder")));
}

TEST(DatasetLayouts, AFolderOfDataSetsNamesThem) {
  const fs::path folder = FreshFolder();
  TumFolder(folder / "desk", 1000);
  fs::create_directories(folder / "empty");
  EXPECT_THAT(OpenError(folder, With(Sensor::kMono)), HasSubstr("give one of desk"));
}

}  // namespace
}  // namespace tutti
