// Measurements of an IMU travel with the frames.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "tests/frontend/dataset/dataset_files.h"
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
