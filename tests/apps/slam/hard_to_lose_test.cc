// What makes other systems lose their way: each with a figure, in the synthetic world.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <opencv2/imgproc.hpp>

#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_room.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/backend/evaluation.h"
#include "tutti/slam/config.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

using testing::Black;
using testing::Recording;

// ---------------------------------------------------------------- recordings

SyntheticOptions TownOptions() {
  SyntheticOptions options = testing::SmallStereoTown(400, 200);
  options.block_m = 30;
  options.laps = 1.6;
  return options;
}

// A lap and a half around a block, 10 frames a second.
const Recording& WholeTown() {
  static const Recording town = [] {
    const testing::RenderedWorld world(TownOptions());
    return testing::Record(world, world.Size());
  }();
  return town;
}

Recording Selected(const Recording& all, const std::vector<std::size_t>& which) {
  Recording out;
  out.rig = all.rig;
  for (const std::size_t i : which) {
    out.frames.push_back(all.frames[i]);
    out.frames.back().index = static_cast<std::int64_t>(out.frames.size()) - 1;
    out.truth.push_back(all.truth[i]);
  }
  return out;
}

std::vector<std::size_t> Range(std::size_t begin, std::size_t end, std::size_t step = 1) {
  std::vector<std::size_t> out;
  for (std::size_t i = begin; i < end; i += step) out.push_back(i);
  return out;
}

// The beginning of the lap.
Recording TownFrames(std::size_t frames) { return Selected(WholeTown(), Range(0, frames)); }

// The same frames in an order of one's own: time goes on evenly.
Recording Carried(const Recording& all, const std::vector<std::size_t>& which) {
  Recording out = Selected(all, which);
  for (std::size_t i = 0; i < out.frames.size(); ++i) {
    out.frames[i].stamp_s = out.truth[i].stamp_s = static_cast<double>(i) / all.rig.rate_hz;
  }
  return out;
}

template <typename Change>
void ForEachImage(InputFrame& frame, const Change& change) {
  for (cv::Mat* image : {&frame.image, &frame.right}) {
    if (image->empty()) continue;
    *image = image->clone();
    change(*image);
  }
}

// ---------------------------------------------------------------- figures

struct Outcome {
  std::size_t posed = 0, frames = 0, relocalized = 0;
  double ate_m = 0;
  double path_m = 0;
  int pieces = 0;  // that have frames
  std::vector<TrackResult> results;
  Trajectory estimate;

  double PosedShare() const { return static_cast<double>(posed) / static_cast<double>(frames); }
};

Outcome Follow(const Recording& recording, RunConfig config = RunConfig()) {
  config.run.threads = 2;
  SlamSystem slam(config, recording.rig);
  Outcome out;
  out.frames = recording.frames.size();
  for (const InputFrame& frame : recording.frames) {
    out.results.push_back(slam.Track(frame));
    const TrackResult& last = out.results.back();
    EXPECT_TRUE(last.T_world_camera.IsFinite()) << frame.index;
    if (last.state != TrackingState::kTracking) {
      EXPECT_FALSE(last.reason.empty()) << frame.index;
    }
  }
  slam.Finish();
  std::map<int, int> pieces;
  for (const int id : slam.odometry()->map().KeyframeIds()) {
    ++pieces[slam.odometry()->map().keyframe(id).piece];
    EXPECT_TRUE(slam.odometry()->map().keyframe(id).T_world_camera.IsFinite());
  }
  out.pieces = static_cast<int>(pieces.size());
  const Trajectory& estimate = out.estimate = FrameTrajectory(slam.odometry()->map());
  out.posed = estimate.size();
  EvaluationOptions options;
  options.max_time_difference_s = 0.02;  // real ground truth has stamps of its own
  options.alignment =
      recording.rig.sensor == Sensor::kMono ? TrajectoryAlignment::kSim3 : TrajectoryAlignment::kSE3;
  const EvaluationReport report = EvaluateTrajectory(recording.truth, estimate, options);
  out.ate_m = report.ate.rmse;
  out.path_m = report.path_length_m;
  out.relocalized = slam.Report().relocalized;
  ::testing::Test::RecordProperty("posed", static_cast<int>(out.posed));
  ::testing::Test::RecordProperty("frames", static_cast<int>(out.frames));
  ::testing::Test::RecordProperty("ate_mm", static_cast<int>(1e3 * out.ate_m));
  std::printf("  %zu of %zu frames posed, %d piece(s), ATE %.3f m of %.1f m\n", out.posed, out.frames,
              out.pieces, out.ate_m, out.path_m);
  return out;
}

// For recordings in which no place is seen again: there is no loop to find, and one member finds none in less
// time than three.
RunConfig OneMemberConfig() {
  RunConfig config;
  config.loops.members = {"orb"};
  return config;
}

// ---------------------------------------------------------------- images

TEST(HardToLose, MotionBlur) {
  SyntheticOptions options = TownOptions();
  options.motion_blur_s = 0.03;
  const Outcome out = Follow(testing::Record(testing::RenderedWorld(options), 60), OneMemberConfig());
  EXPECT_EQ(out.posed, out.frames);
  EXPECT_LT(out.ate_m, 0.01 * out.path_m);
}

// A hand that shakes in a room, up to 200 deg/s about each axis, seen by a camera that takes 30 ms for an
// image.
SyntheticOptions Shaken(int width = 320, int height = 240) {
  SyntheticOptions options = testing::SmallRgbdRoom(width, height);
  options.rate_hz = 30;
  options.kinect_noise = true;
  options.shake_deg_per_s = 200;
  return options;
}

// The largest error of the motion from one frame to the next [m], of the first so many.
double LargestStepError(const Trajectory& truth, const Trajectory& estimate, std::size_t frames) {
  double largest = 0;
  for (std::size_t i = 1; i < std::min({frames, truth.size(), estimate.size()}); ++i) {
    const Pose should = truth[i - 1].pose.Inverse() * truth[i].pose,
               is = estimate[i - 1].pose.Inverse() * estimate[i].pose;
    largest = std::max(largest, (should.translation - is.translation).norm());
  }
  return largest;
}

TEST(HardToLose, ARollingShutterInAShakingHand) {
  SyntheticOptions options = Shaken();
  options.readout_s = 0.03;
  Recording rolling = testing::Record(testing::RenderedWorld(options), 120);
  const Outcome out = Follow(rolling, OneMemberConfig());
  EXPECT_EQ(out.posed, out.frames);
  EXPECT_LT(out.ate_m, 0.01 + 0.005 * out.path_m);
  EXPECT_LT(LargestStepError(rolling.truth, out.estimate, 4), 0.006) << "0.0096 as if it began at rest";
  rolling.rig.readout_s = 0;
  EXPECT_GT(Follow(rolling, OneMemberConfig()).ate_m, 1.5 * out.ate_m) << "what the readout is known for";
}

// Streaks are up to 45 px long, and no frame of a second and more is sharp.
TEST(HardToLose, BlurInAShakingHand) {
  for (const double readout_s : {0.0, 0.03}) {
    SyntheticOptions options = Shaken(400, 300);
    options.motion_blur_s = 0.03;
    options.readout_s = readout_s;
    const Recording blurred = testing::Record(testing::RenderedWorld(options), 120);
    const Outcome out = Follow(blurred, OneMemberConfig());
    EXPECT_EQ(out.posed, out.frames) << readout_s;
    EXPECT_LT(out.ate_m, 0.02 * out.path_m) << readout_s << ": less on the longer way of `bench fast`";
    EXPECT_LT(LargestStepError(blurred.truth, out.estimate, out.frames), 0.03) << readout_s;
  }
}

TEST(HardToLose, ExposureJumps) {
  Recording jumps = TownFrames(60);
  for (std::size_t i = 15; i < jumps.frames.size(); ++i) {
    ForEachImage(jumps.frames[i], [&](cv::Mat& image) {
      const int step = static_cast<int>(i / 15) % 3;
      image.convertTo(image, -1, step == 1 ? 0.4 : step == 2 ? 1.7 : 1, step == 1 ? 0 : step == 2 ? 25 : 0);
    });
  }
  const Outcome out = Follow(jumps, OneMemberConfig());
  EXPECT_EQ(out.posed, out.frames);
  EXPECT_LT(out.ate_m, 0.01 * out.path_m);
}

TEST(HardToLose, APlainMovingObjectCoversThirtyPercentOfTheView) {
  Recording covered = TownFrames(60);
  const cv::Size size = covered.frames.front().image.size();
  // The plain side of a lorry: shades, an edge, a few marks.
  cv::Mat object(size.height, size.width * 3 / 10, CV_8UC1, cv::Scalar(150));
  constexpr int kRowsOfAShade = 8;
  for (int shade = 1; shade * kRowsOfAShade < object.rows; ++shade)
    object.rowRange(shade * kRowsOfAShade, std::min((shade + 1) * kRowsOfAShade, object.rows)) +=
        cv::Scalar(shade);
  cv::rectangle(object, cv::Rect(0, 0, object.cols, object.rows), cv::Scalar(40), 3);
  for (int k = 0; k < 6; ++k)
    cv::circle(object, {20 + 15 * k, 40 + 20 * (k % 3)}, 4, cv::Scalar(60), cv::FILLED);
  for (std::size_t i = 10; i < covered.frames.size(); ++i) {
    const int x = static_cast<int>(i - 10) * (size.width - object.cols) / 50;
    constexpr int kDisparity = 12;
    int right = 0;
    ForEachImage(covered.frames[i], [&](cv::Mat& image) {
      object.copyTo(image(cv::Rect(std::max(0, x - kDisparity * right++), 0, object.cols, object.rows)));
    });
  }
  const Outcome out = Follow(covered, OneMemberConfig());
  EXPECT_EQ(out.posed, out.frames);
  EXPECT_LT(out.ate_m, 0.01 * out.path_m);
}

// A door of plain paint fills the view for a second and more. Where it is, its surface tells; along it, the
// motion goes on.
TEST(HardToLose, APlainDoorBesideTheWay) {
  SyntheticOptions options = testing::SmallRgbdRoom(320, 240);
  options.bare_fraction = 0.3;
  options.plain_doors = 3;
  options.noise_sigma = 1;
  options.rate_hz = 10;
  const Outcome out = Follow(testing::Record(testing::RenderedWorld(options), 60), OneMemberConfig());
  EXPECT_EQ(out.posed, out.frames);
  EXPECT_EQ(out.pieces, 1);
  EXPECT_LT(out.ate_m, 0.2);
}

// ---------------------------------------------------------------- motion

TEST(HardToLose, TurningOnTheSpot) {
  const testing::RenderedWorld world(testing::SmallRgbdRoom(320, 240));
  Recording turning;
  turning.rig = testing::RigOf(world);
  constexpr int kFrames = 150;  // a full turn in 10 s
  for (int i = 0; i < kFrames; ++i) {
    const Pose turned(ExpSO3(Eigen::Vector3d(0, 2 * M_PI * i / kFrames, 0)), Eigen::Vector3d::Zero());
    turning.Add(world.World().RenderFrom(static_cast<std::size_t>(i), turned));
  }
  RunConfig config;
  SlamSystem slam(config, turning.rig);
  TrackResult last;
  for (const InputFrame& frame : turning.frames) {
    last = slam.Track(frame);
    ASSERT_EQ(last.state, TrackingState::kTracking) << frame.index << ": " << last.reason;
  }
  const Pose error = turning.truth.back().pose.Inverse() * last.T_world_camera;
  EXPECT_LT(error.translation.norm(), 0.1);
  EXPECT_LT(LogSO3(error.rotation).norm(), 2 * M_PI / 180);
}

TEST(HardToLose, StandingStillForAMinute) {
  const testing::RenderedWorld world([] {
    SyntheticOptions options = TownOptions();
    options.noise_sigma = 3;
    return options;
  }());
  Recording still = testing::Record(world, 20);
  constexpr std::size_t kStill = 240;  // a quarter of a second apart
  std::vector<SyntheticFrame> noises;
  for (std::size_t i = 0; i < 10; ++i)
    noises.push_back(world.World().RenderFrom(19 + i, still.truth.back().pose));
  for (std::size_t i = 0; i < kStill; ++i) {
    SyntheticFrame frame = noises[(i * 7 + i / 10) % noises.size()];
    frame.stamp_s = world.World().Stamp(20) + 0.25 * static_cast<double>(i);
    still.Add(frame);
  }
  RunConfig config;
  SlamSystem slam(config, still.rig);
  Pose first, last;
  std::size_t keyframes = 0;
  for (const InputFrame& frame : still.frames) {
    const TrackResult result = slam.Track(frame);
    ASSERT_EQ(result.state, TrackingState::kTracking) << frame.index << ": " << result.reason;
    last = result.T_world_camera;
    if (frame.index == 25) {
      first = last;
      keyframes = slam.odometry()->map().KeyframeIds().size();
    }
  }
  EXPECT_LT((first.Inverse() * last).translation.norm(), 0.06) << "noise of two poses, no drift";
  EXPECT_LE(slam.odometry()->map().KeyframeIds().size(), keyframes + 3) << "the map grows by the minute";
}

// ---------------------------------------------------------------- missing frames

TEST(HardToLose, EverySecondFrameIsMissing) {
  const Outcome out = Follow(Selected(TownFrames(120), Range(0, 120, 2)), OneMemberConfig());
  EXPECT_EQ(out.posed, out.frames);
  EXPECT_LT(out.ate_m, 0.01 * out.path_m);
}

TEST(HardToLose, TwoOfThreeFramesAreMissing) {
  const Outcome out = Follow(Selected(TownFrames(120), Range(0, 120, 3)), OneMemberConfig());
  EXPECT_EQ(out.posed, out.frames);
  EXPECT_LT(out.ate_m, 0.01 * out.path_m);
}

TEST(HardToLose, AGapOfASecond) {
  std::vector<std::size_t> which = Range(0, 12);
  for (const std::size_t i : Range(22, 80)) which.push_back(i);
  const Outcome out = Follow(Selected(TownFrames(80), which), OneMemberConfig());
  EXPECT_EQ(out.posed, out.frames);
  EXPECT_LT(out.ate_m, 0.01 * out.path_m);
}

// Dark for three seconds while the car drives on: what is seen then is new, and joins when the loop closes.
TEST(HardToLose, BlackOutOfThreeSeconds) {
  Recording dark = WholeTown();
  for (std::size_t i = 60; i < 90; ++i) dark.frames[i] = Black(dark.frames[i]);
  const Outcome out = Follow(dark);
  EXPECT_EQ(out.results[60].state, TrackingState::kLost);
  EXPECT_EQ(out.pieces, 1);
  EXPECT_GE(out.posed, out.frames - 30 - 10);
  EXPECT_LT(out.ate_m, 0.01 * out.path_m);
}

TEST(HardToLose, KidnappedToAPlaceSeenBefore) {
  std::vector<std::size_t> which = Range(0, 120);
  for (const std::size_t i : Range(10, 60)) which.push_back(i);
  const Recording kidnapped = Carried(TownFrames(120), which);
  const Outcome out = Follow(kidnapped);
  EXPECT_EQ(out.relocalized, 1U);
  EXPECT_EQ(out.pieces, 1);
  EXPECT_EQ(out.posed, out.frames);
  EXPECT_LT(out.ate_m, 0.01 * out.path_m);
}

TEST(HardToLose, KidnappedToAPlaceSeenBeforeWithTheLeftCameraAlone) {
  std::vector<std::size_t> which = Range(0, 120);
  for (const std::size_t i : Range(10, 40)) which.push_back(i);
  Recording kidnapped = Carried(TownFrames(120), which);
  for (std::size_t i = 120; i < 130; ++i) kidnapped.frames[i].right = cv::Mat();
  const Outcome out = Follow(kidnapped);
  EXPECT_EQ(out.relocalized, 1U);
  EXPECT_EQ(out.pieces, 1);
  EXPECT_EQ(out.posed, out.frames);
  EXPECT_LT(out.ate_m, 0.01 * out.path_m);
}

TEST(HardToLose, KidnappedToANewPlaceThatIsJoinedLater) {
  const Recording& town = WholeTown();
  const std::size_t begin = town.frames.size() / 3;
  std::vector<std::size_t> which = Range(0, begin);
  for (const std::size_t i : Range(begin + 40, town.frames.size())) which.push_back(i);
  const Recording kidnapped = Carried(town, which);
  const Outcome out = Follow(kidnapped);
  EXPECT_EQ(out.pieces, 1);
  EXPECT_GE(out.posed, out.frames - 15);
  EXPECT_LT(out.ate_m, 0.01 * out.path_m);
}

// ---------------------------------------------------------------- real images

// Frames of a real sequence with the time stamps of its readers; body and camera are the same in these.
Recording Real(const std::filesystem::path& folder, const std::string& config, std::size_t most) {
  const auto dataset =
      OpenDataset(folder, LoadConfig(testing::SourceDir() / "data" / "configs" / config).dataset);
  std::vector<std::string> warnings;
  const Trajectory truth = dataset->ReadGroundTruth(*dataset->GroundTruthFile(), &warnings);
  Recording out;
  out.rig = dataset->Rig();
  for (std::size_t i = 0; i < std::min(most, dataset->Size()); ++i) {
    const ReadResult read = dataset->Read(i);
    if (!read.frame) continue;
    out.frames.push_back(*read.frame);
  }
  out.truth = truth;
  return out;
}

std::vector<std::size_t> AllBut(std::size_t size, std::size_t begin, std::size_t end) {
  std::vector<std::size_t> which = Range(0, begin);
  for (const std::size_t i : Range(end, size)) which.push_back(i);
  return which;
}

TEST(HardToLoseReal, HandHeldGapOfASecondAndBlackOutOfThree) {
  TUTTI_REQUIRE_DATA(folder, "redkitchen");
  Recording kitchen = Real(folder, "7scenes.yaml", 280);
  for (std::size_t i = 200; i < 245; ++i) kitchen.frames[i] = Black(kitchen.frames[i]);
  std::vector<InputFrame> kept;
  for (const std::size_t i : AllBut(kitchen.frames.size(), 160, 175)) kept.push_back(kitchen.frames[i]);
  kitchen.frames = kept;
  const Outcome out = Follow(kitchen, LoadConfig(testing::SourceDir() / "data/configs/7scenes.yaml"));
  EXPECT_EQ(out.pieces, 1);
  EXPECT_EQ(out.posed, out.frames - 45);
  EXPECT_LT(out.ate_m, 0.08);
}

TEST(HardToLoseReal, CarWithEverySecondFrameMissingAndAGapOfASecond) {
  TUTTI_REQUIRE_DATA(folder, "kitti_00_head");
  Recording street = Real(folder, "kitti_00-02_mono.yaml", 200);
  std::vector<InputFrame> kept;
  for (const std::size_t i : AllBut(street.frames.size(), 60, 70)) {
    if (i % 2 == 0) kept.push_back(street.frames[i]);
  }
  street.frames = kept;
  const Outcome out = Follow(street, LoadConfig(testing::SourceDir() / "data/configs/kitti_00-02_mono.yaml"));
  EXPECT_EQ(out.pieces, 1);
  EXPECT_GE(out.posed, out.frames - 5);
  EXPECT_LT(out.ate_m, 0.02 * out.path_m);
}

}  // namespace
}  // namespace tutti
