// Measurements of an IMU travel with the frames.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/bag_writer.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::FrameOf;
using testing::MakeKitti;
using testing::With;

// KITTI's layout, ten frames a second, with 200 measurements a second from 0.3 s before the first image on.
fs::path FolderWithImu(const char* name, double unit = 1) {
  const fs::path folder = testing::FreshFolder() / "with_imu";
  MakeKitti(folder, 10, false);
  std::ofstream out(folder / name);
  out.precision(12);
  for (int i = -60; i < 260; ++i)
    out << i * 0.005 << " 0.1 " << 0.2 + 0.001 * (i % 3) << " 0.3 " << unit * 0.1 << " 0.2 " << unit * 9.8
        << "\n";
  return folder;
}

TEST(DatasetImu, GivesEachMeasurementWithOneFrame) {
  const fs::path folder = FolderWithImu("imu.txt");
  const std::unique_ptr<Dataset> dataset = OpenDataset(folder, With(Sensor::kMono, true));
  ASSERT_TRUE(dataset->Imu());
  EXPECT_TRUE(dataset->Imu()->findings.empty());
  EXPECT_NEAR(dataset->Imu()->rate_hz, 200, 0.1);
  double last = -1;
  std::size_t count = 0;
  for (std::size_t i = 0; i < dataset->Size(); ++i) {
    const InputFrame frame = FrameOf(*dataset, i);
    ASSERT_FALSE(frame.imu.empty());
    for (const ImuSample& sample : frame.imu) {
      EXPECT_GT(sample.stamp_s, last);
      last = sample.stamp_s;
      ++count;
    }
    EXPECT_GE(last, frame.stamp_s);
    EXPECT_LT(last, frame.stamp_s + 0.1);
  }
  EXPECT_GT(count, 190U);
  EXPECT_NE(dataset->Warnings().back().find("200 Hz"), std::string::npos);
}

TEST(DatasetImu, IsLeftOutIfItContradictsItselfOrIsNotWanted) {
  const fs::path folder = FolderWithImu("imu.csv", 1 / 9.80665);
  DatasetOptions options = With(Sensor::kMono, true);
  const std::unique_ptr<Dataset> dataset = OpenDataset(folder, options);
  ASSERT_TRUE(dataset->Imu());
  ASSERT_EQ(dataset->Imu()->findings.size(), 1U);
  EXPECT_TRUE(FrameOf(*dataset, 3).imu.empty());
  EXPECT_FALSE(dataset->Rig().imu);
  EXPECT_NE(dataset->Warnings().back().find("is left out"), std::string::npos);
  options.imu = false;
  EXPECT_FALSE(OpenDataset(folder, options)->Imu());
}

TEST(DatasetImu, DamagedLeavesTheImagesAsTheyAre) {
  const fs::path folder = FolderWithImu("imu.txt");
  std::ofstream(folder / "imu.txt", std::ios::app) << "1.4 0.1 nan\n";
  const std::unique_ptr<Dataset> dataset = OpenDataset(folder, With(Sensor::kMono, true));
  ASSERT_TRUE(dataset->Imu());
  ASSERT_EQ(dataset->Imu()->findings.size(), 1U);
  EXPECT_NE(dataset->Imu()->findings[0].measured.find("imu.txt:321"), std::string::npos)
      << dataset->Imu()->findings[0].measured;
  EXPECT_TRUE(FrameOf(*dataset, 3).imu.empty());
}

// A bag with four images and the measurements of these topics; in "accel" the accelerations alone, at other
// times.
fs::path BagWithImu(const std::vector<std::string>& topics) {
  testing::BagWriter bag;
  const cv::Mat image(48, 64, CV_8UC1, cv::Scalar(90));
  bag.Write("/camera/camera_info", "sensor_msgs/CameraInfo",
            testing::CameraInfoMessage({64, 48}, {60, 0, 32, 0, 60, 24, 0, 0, 1}, "plumb_bob", {}));
  for (int i = 0; i < 10; ++i)
    bag.Write("/camera/image", "sensor_msgs/Image", testing::ImageMessage(image, "mono8", 100 + 0.1 * i));
  for (int i = -20; i < 220; ++i) {
    for (const std::string& topic : topics) {
      const bool accel = topic.find("accel") != std::string::npos,
                 gyro = topic.find("gyro") != std::string::npos;
      ImuSample sample;
      sample.stamp_s = 100 + 0.005 * i + (accel ? 0.0025 : 0);
      if (!accel) sample.gyro = {0.1, 0.2 + 0.001 * (i % 3), 0.3};
      if (!gyro) sample.acceleration = {0.01 * i, 0, 9.8};
      bag.Write(topic, "sensor_msgs/Imu", testing::ImuMessage(sample));
    }
  }
  return testing::FreshFile("imu.bag", bag.Finish());
}

TEST(DatasetImu, OfABagIsItsOnlyTopicOrGyroscopeAndAccelerometer) {
  using Topics = std::vector<std::string>;
  for (const Topics& topics : {Topics{"/imu"}, Topics{"/camera/gyro/sample", "/camera/accel/sample"}}) {
    const std::unique_ptr<Dataset> dataset = OpenDataset(BagWithImu(topics), With(Sensor::kMono));
    ASSERT_TRUE(dataset->Imu());
    EXPECT_TRUE(dataset->Imu()->findings.empty()) << dataset->Warnings().back();
    EXPECT_NEAR(dataset->Imu()->rate_hz, 200, 0.1);
    const InputFrame frame = FrameOf(*dataset, 3);
    ASSERT_GE(frame.imu.size(), 19U);
    const ImuSample& sample = frame.imu[5];
    EXPECT_NEAR(sample.gyro.x(), 0.1, 1e-12);
    EXPECT_NEAR(sample.acceleration.x(),
                0.01 * (sample.stamp_s - 100) / 0.005 - (topics.size() > 1 ? 0.005 : 0), 1e-6);
  }
}

TEST(DatasetImu, WhichOfABagIsMeantIsAsked) {
  const fs::path bag = BagWithImu({"/imu/left", "/imu/right"});
  DatasetOptions options = With(Sensor::kMono);
  const std::unique_ptr<Dataset> dataset = OpenDataset(bag, options);
  EXPECT_TRUE(FrameOf(*dataset, 3).imu.empty()) << "the images can be used all the same";
  EXPECT_NE(dataset->Warnings().back().find("dataset.imu_topic to one of: /imu/left /imu/right"),
            std::string::npos)
      << dataset->Warnings().back();
  options.imu_topic = "/imu/right";
  EXPECT_FALSE(FrameOf(*OpenDataset(bag, options), 3).imu.empty());
  options.imu_topic = "/imu/centre";
  EXPECT_THAT(testing::ErrorOf([&] { OpenDataset(bag, options); }), ::testing::HasSubstr("/imu/centre"));
}

TEST(DatasetImu, OfEurocKnowsItsMountingAndNoise) {
  TUTTI_REQUIRE_DATA(data, "euroc_v101_head");
  DatasetOptions options = With(Sensor::kStereo);
  const std::unique_ptr<Dataset> dataset = OpenDataset(data, options);
  ASSERT_TRUE(dataset->Imu());
  EXPECT_TRUE(dataset->Imu()->findings.empty()) << dataset->Imu()->findings[0].measured;
  ASSERT_TRUE(dataset->Rig().imu && dataset->Rig().imu->T_camera_imu);
  EXPECT_NEAR(dataset->Rig().imu->gyro_noise, 1.6968e-4, 1e-9);
  const Pose around = *dataset->Rig().imu->T_camera_imu * dataset->Rig().T_body_camera;
  EXPECT_LT(around.Angle() + around.translation.norm(), 1e-9);
  options.T_camera_imu = {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0.5, 0, 0, 0, 1};
  options.time_offset_s = 0.01;
  const std::unique_ptr<Dataset> told = OpenDataset(data, options);
  EXPECT_NEAR(told->Rig().imu->T_camera_imu->translation.z(), 0.5, 0.01);
  EXPECT_EQ(told->Rig().imu->time_offset_s, 0.01);
}

}  // namespace
}  // namespace tutti
