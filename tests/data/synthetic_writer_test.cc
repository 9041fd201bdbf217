#include "data/synthetic/synthetic_world.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "tests/data/small_world.h"
#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {
using testing::FreshFolder, testing::SmallWorld, testing::With;

SyntheticWorld RoomOf(int frames, std::uint64_t seed = 1) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kRoom, SyntheticSensor::kMono);
  options.frames = frames;
  options.seed = seed;
  return SyntheticWorld(options);
}

SyntheticWriteOptions Forced() {
  SyntheticWriteOptions options;
  options.force = true;
  return options;
}

TEST(SyntheticWriter, WrittenStereoTownIsReadBackByTheKittiReader) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kTown, SyntheticSensor::kStereo);
  options.frames = 5;
  const SyntheticWorld world(options);
  const auto folder = FreshFolder() / "town";
  SyntheticWriteOptions write;
  write.threads = 2;
  EXPECT_EQ(WriteSyntheticDataset(world, folder, write), 5U);
  const auto data = OpenDataset(folder, With(Sensor::kStereo));
  ASSERT_EQ(data->Size(), 5U);
  EXPECT_NEAR(data->Rig().baseline_m, 0.54, 1e-9);
  EXPECT_NEAR(data->Rig().camera.fx, world.Camera().fx, 1e-9);
  const SyntheticFrame frame = world.Render(3);
  EXPECT_EQ(cv::norm(data->Read(3).frame->image, frame.image, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(data->Read(3).frame->right, frame.right, cv::NORM_INF), 0);
  const Trajectory truth = data->ReadGroundTruth(*data->GroundTruthFile(), nullptr);
  EXPECT_LT((truth[4].pose.translation - world.PoseOf(4).translation).norm(), 1e-9);
}

TEST(SyntheticWriter, WrittenRoomIsReadBackByTheTumReader) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kRoom, SyntheticSensor::kRgbd);
  options.frames = 4;
  options.readout_s = 0.03;
  const SyntheticWorld world(options);
  const auto folder = FreshFolder();
  WriteSyntheticDataset(world, folder);
  std::ifstream config(folder / "config.yaml");
  std::stringstream text;
  text << config.rdbuf();
  EXPECT_NE(text.str().find("readout_s: 0.03 "), std::string::npos) << text.str();
  DatasetOptions read = With(Sensor::kRgbd);
  read.camera = world.Camera();
  const auto data = OpenDataset(folder, read);
  ASSERT_EQ(data->Size(), 4U);
  EXPECT_LT(cv::norm(data->Read(2).frame->depth_m, world.Render(2).depth_m, cv::NORM_INF), 2e-4);
  const Trajectory truth = data->ReadGroundTruth(*data->GroundTruthFile(), nullptr);
  ASSERT_EQ(truth.size(), 4U);
  EXPECT_LT((truth[3].pose.translation - world.PoseOf(3).translation).norm(), 1e-8);
  EXPECT_NEAR(truth[3].stamp_s, data->Stamp(3), 1e-6);
}

TEST(SyntheticWriter, SidesLookLeftAndRightAndAreNumberedInPairs) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kTown, SyntheticSensor::kSides);
  options.frames = 3;
  options.sides_deg = 40;
  const SyntheticWorld world(options);
  // A camera that looks 40 degrees to the left of the way sees at its right edge what lies ahead; the one to
  // the right sees it at its left edge. So the two images are different and both are full.
  const SyntheticFrame frame = world.Render(1);
  ASSERT_EQ(frame.right.size(), frame.image.size());
  EXPECT_GT(cv::norm(frame.image, frame.right, cv::NORM_L1) / static_cast<double>(frame.image.total()), 5);
  const auto folder = FreshFolder();
  EXPECT_EQ(WriteSyntheticDataset(world, folder), 3U);
  const cv::Mat left = cv::imread((folder / "images/000003.png").string(), cv::IMREAD_UNCHANGED);
  const cv::Mat right = cv::imread((folder / "images/000004.png").string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(cv::norm(left, frame.image, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(right, frame.right, cv::NORM_INF), 0);
  EXPECT_EQ(ReadTrajectory(folder / "poses.txt", TrajectoryFormat::kKitti).size(), 3U);
}

TEST(SyntheticWriter, AFullFolderIsRefusedUnlessForced) {
  const auto folder = FreshFolder();
  WriteSyntheticDataset(RoomOf(4), folder);
  const SyntheticWorld shorter = RoomOf(2);
  EXPECT_THROW(WriteSyntheticDataset(shorter, folder), InputError);
  EXPECT_EQ(WriteSyntheticDataset(shorter, folder, Forced()), 2U);
  EXPECT_EQ(OpenDataset(folder, With(Sensor::kMono))->Size(), 2U);  // no old frames left
}

TEST(SyntheticWriter, ForceRemovesAndWritesNothingBehindALink) {
  const SyntheticWorld world = RoomOf(2);
  const auto folder = FreshFolder(), other = folder / "other", mine = folder / "mine";
  WriteSyntheticDataset(world, other);
  WriteSyntheticDataset(world, mine);
  std::filesystem::remove_all(mine / "image_0");
  std::filesystem::create_directory_symlink(other / "image_0", mine / "image_0");
  EXPECT_THROW(WriteSyntheticDataset(world, mine, Forced()), InputError);
  EXPECT_TRUE(std::filesystem::exists(other / "image_0" / "000001.png"));
  std::filesystem::remove(mine / "image_0");
  for (const char* name : {"config.yaml", "poses.txt"}) {
    std::filesystem::remove(mine / name);
    std::filesystem::create_symlink(other / name, mine / name);
  }
  const auto written = std::filesystem::last_write_time(other / "config.yaml");
  EXPECT_EQ(WriteSyntheticDataset(RoomOf(2, 2), mine, Forced()), 2U);  // of another seed: another text
  EXPECT_FALSE(std::filesystem::is_symlink(mine / "config.yaml"));
  EXPECT_EQ(std::filesystem::last_write_time(other / "config.yaml"), written);
}

TEST(SyntheticWriter, AnotherOnesRecordingStaysWhateverItsConfigurationIs) {
  const SyntheticWorld world = RoomOf(2);
  const auto folder = FreshFolder(), config = folder / "config.yaml",
             image = folder / "image_0" / "000000.png";
  std::filesystem::create_directories(folder / "image_0");
  std::ofstream(image) << "another one's";
  EXPECT_THROW(WriteSyntheticDataset(world, folder, Forced()), InputError);
  ASSERT_EQ(mkfifo(config.c_str(), 0600), 0);  // opened, it would wait for ever
  EXPECT_THROW(WriteSyntheticDataset(world, folder, Forced()), InputError);
  std::filesystem::remove(config);
  std::ofstream(config) << "#";
  std::filesystem::resize_file(config, std::uintmax_t{300} << 30);  // one line of zeros
  EXPECT_THROW(WriteSyntheticDataset(world, folder, Forced()), InputError);
  EXPECT_EQ(std::filesystem::file_size(image), 13U);
  std::filesystem::remove(config);
  WriteSyntheticDataset(world, folder / "own");
  std::filesystem::copy(folder / "own" / "config.yaml", config);
  EXPECT_EQ(WriteSyntheticDataset(world, folder, Forced()), 2U);  // now it says that it is tutti's
}

TEST(SyntheticWriter, StoppingKeepsACompleteBeginning) {
  const auto folder = FreshFolder();
  SyntheticWriteOptions write;
  write.threads = 2;
  write.progress = [](std::size_t done, std::size_t) { return done < 3; };
  const std::size_t written = WriteSyntheticDataset(RoomOf(20), folder, write);
  EXPECT_GE(written, 3U);
  EXPECT_LT(written, 20U);
  const auto data = OpenDataset(folder, With(Sensor::kMono));
  EXPECT_EQ(data->Size(), written);
  EXPECT_TRUE(data->Read(written - 1).frame);
  EXPECT_EQ(data->ReadGroundTruth(folder / "poses.txt", nullptr).size(), written);
}

}  // namespace
}  // namespace tutti
