// A focal length that nobody told is found in the images, or it is said that it can't be.
#include "apps/run/focal_length.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "apps/run/recording.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/recording.h"
#include "tests/support/small_room.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr double kRoomFocal = 260;
constexpr int kRoomFrames = 50;

// A walk around in a room, in colour and depth.
const fs::path& RoomToMeasure() {
  static const fs::path room = testing::GeneratedDataset([] {
    SyntheticOptions options = testing::SmallRgbdRoom(320, 240);
    options.focal_px = kRoomFocal;
    options.rate_hz = 5;
    options.frames = kRoomFrames;
    return options;
  }());
  return room;
}

RunConfig RoomConfig(double focal_px) {
  CameraRequest camera;
  const std::string focal = std::to_string(focal_px);
  camera.camera = focal + "," + focal + ",159.5,119.5";
  return Recognise(RoomToMeasure(), camera).config;
}

TEST(FocalLength, OfARoomIsFoundFromAWrongOne) {
  for (const double share : {0.8, 1.25}) {
    const FocalLength found =
        MeasureFocalLength(RoomToMeasure(), RoomConfig(share * kRoomFocal), kRoomFrames);
    ASSERT_TRUE(found.measured) << found.reason;
    EXPECT_NEAR(found.camera.fx / kRoomFocal, 1, 0.05);
    EXPECT_LT(std::abs(std::log(found.camera.fx / kRoomFocal)), 4 * found.sigma + 0.01);
    EXPECT_EQ(found.camera.fx, found.camera.fy);
  }
}

TEST(FocalLength, OfPixelsThatAreNotSquareKeepsTheirShape) {
  const fs::path narrow = testing::FreshFolder() / "narrow";
  fs::copy(RoomToMeasure(), narrow, fs::copy_options::recursive);
  for (const char* folder : {"rgb", "depth"}) {
    for (const auto& entry : fs::directory_iterator(narrow / folder)) {
      cv::Mat image = cv::imread(entry.path().string(), cv::IMREAD_UNCHANGED);
      cv::resize(image, image, {240, 240}, 0, 0,
                 image.type() == CV_16UC1 ? cv::INTER_NEAREST : cv::INTER_AREA);
      cv::imwrite(entry.path().string(), image);
    }
  }
  RunConfig config = RoomConfig(kRoomFocal);
  PinholeCamera& camera = *config.dataset.camera;
  camera.width = 240;
  camera.fx = 0.9 * 0.75 * kRoomFocal;
  camera.fy = 0.9 * kRoomFocal;
  camera.cx = 119.5;
  const FocalLength found = MeasureFocalLength(narrow, config, kRoomFrames);
  ASSERT_TRUE(found.measured) << found.reason;
  EXPECT_NEAR(found.camera.fx / (0.75 * kRoomFocal), 1, 0.05);
  EXPECT_NEAR(found.camera.fx / found.camera.fy, 0.75, 1e-9);
}

TEST(FocalLength, IsTheSameAgain) {
  const RunConfig config = RoomConfig(1.1 * kRoomFocal);
  const FocalLength once = MeasureFocalLength(RoomToMeasure(), config, 20),
                    again = MeasureFocalLength(RoomToMeasure(), config, 20);
  EXPECT_EQ(once.measured, again.measured);
  EXPECT_EQ(once.camera.fx, again.camera.fx);
  EXPECT_EQ(once.sigma, again.sigma);
}

// A camera turns by nearly half of its view from frame to frame at first: the first keyframes see
// nothing that three of them see.
TEST(LensCheck, OfAMapWhoseFirstKeyframesSeeNothingOfTheRest) {
  SyntheticOptions options = testing::SmallRgbdRoom(320, 240);
  options.focal_px = kRoomFocal;
  options.rate_hz = 5;
  const SyntheticWorld world(options);
  Odometry odometry(OdometryOptions(), testing::RigOf(world));
  double turned = 0;
  for (int i = 0; i < 30; ++i) {
    Pose pose = world.PoseOf(static_cast<std::size_t>(i));
    pose.rotation = pose.rotation * ExpSO3({0, turned, 0});
    turned += i < 4 ? 0.5 : 0.08;
    const SyntheticFrame rendered = world.RenderFrom(static_cast<std::size_t>(i), pose);
    InputFrame frame;
    frame.index = i;
    frame.stamp_s = rendered.stamp_s;
    frame.image = rendered.image;
    frame.depth_m = rendered.depth_m;
    ASSERT_EQ(odometry.Track(frame).state, TrackingState::kTracking) << i;
  }
  odometry.FinishMapping();
  const auto shared = [&](int first, int second) {
    const std::vector<int> a = ViewOf(odometry.map(), first).landmarks,
                           b = ViewOf(odometry.map(), second).landmarks;
    return std::count_if(a.begin(), a.end(),
                         [&](int l) { return l >= 0 && std::find(b.begin(), b.end(), l) != b.end(); });
  };
  ASSERT_GT(shared(0, 1), 0);
  ASSERT_EQ(shared(0, 2), 0) << "what this test is about";
  const LensCheck check = CheckLens(odometry);
  ASSERT_TRUE(check.measured);
  EXPECT_NEAR(check.focal_ratio, 1, 0.03);
}

TEST(FocalLength, OfAFewFramesIsNotMeasured) {
  const FocalLength found = MeasureFocalLength(RoomToMeasure(), RoomConfig(1.2 * kRoomFocal), 4);
  EXPECT_FALSE(found.measured);
  EXPECT_THAT(found.reason, HasSubstr("too little of it"));
  EXPECT_EQ(found.frames, 4);
  EXPECT_DOUBLE_EQ(found.camera.fx, 1.2 * kRoomFocal);
}

TEST(FocalLength, OfKittiAndRedkitchenIsFoundWithinFivePercent) {
  for (const auto& [name, truth] :
       {std::pair<const char*, double>{"kitti_00_head", 718.856}, {"redkitchen", 520}}) {
    TUTTI_REQUIRE_DATA(folder, name);
    CameraRequest camera;
    camera.view_deg = 67;  // what is guessed where there is no calibration
    const Recording recording = Recognise(folder, camera);
    const FocalLength found = MeasureFocalLength(folder, recording.config, 120);
    ASSERT_TRUE(found.measured) << name << ": " << found.reason;
    std::printf("  %s: %.4f\n", name, found.camera.fx / truth);
    EXPECT_NEAR(found.camera.fx / truth, 1, 0.05) << name;
  }
}

}  // namespace
}  // namespace tutti
