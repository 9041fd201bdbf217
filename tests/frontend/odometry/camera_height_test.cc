#include "frontend/odometry/camera_height.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "data/synthetic/synthetic_world.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"

namespace tutti {
namespace {

constexpr std::size_t kDriven = 160;
constexpr double kDepth = 15;  // [m], about
constexpr double kInterval_s = 0.1;

const testing::RenderedWorld& LongTown() {
  static const testing::RenderedWorld town([] {
    SyntheticOptions options = testing::SmallStereoTown(640, 320);
    options.sensor = SyntheticSensor::kMono;
    options.block_m = 200;  // no curve: as fast at the end as at first
    return options;
  }());
  return town;
}

Pose PoseOf(std::size_t i) { return LongTown().World().PoseOf(i); }

std::shared_ptr<const FrameFeatures> Features(const cv::Mat& image) {
  auto features = std::make_shared<FrameFeatures>();
  features->pyramid = std::make_shared<const Pyramid>(std::vector<cv::Mat>(1, image));
  return features;
}

// Between two frames, on a straight road.
Pose PoseAt(double time) {
  const auto before = static_cast<std::size_t>(time);
  Pose pose = PoseOf(before);
  pose.translation +=
      (time - static_cast<double>(before)) * (PoseOf(before + 1).translation - pose.translation);
  return pose;
}

using OverFrames = std::function<double(std::size_t)>;

// A drive of whose map the scale changes by `rate` a frame; where a drift is told, it is taken out if
// `corrected`. `time`: of each frame [intervals of the world]. Returns the logarithm of the scale at its end,
// over where it was at first.
double DriveOn(
    const OverFrames& rate, bool corrected, CameraHeight* height,
    const OverFrames& time = [](std::size_t i) { return static_cast<double>(i); }) {
  double scale = 1;
  Pose T_world_camera = PoseOf(0), last = T_world_camera;
  for (std::size_t i = 0; time(i) < static_cast<double>(kDriven); ++i) {
    const double interval = i > 0 ? time(i) - time(i - 1) : 1;
    if (i > 0) {
      Pose step = PoseAt(time(i - 1)).Inverse() * PoseAt(time(i));
      scale *= std::exp(rate(i));
      step.translation *= scale;
      T_world_camera = last * step;
    }
    const bool rendered = time(i) == std::floor(time(i));
    const auto frame = static_cast<std::size_t>(time(i));
    const cv::Mat image = rendered ? LongTown().Render(frame).image
                                   : LongTown().World().RenderFrom(frame, PoseAt(time(i))).image;
    height->See(LongTown().Camera(), Features(image), T_world_camera.Inverse(), last.Inverse(), kDepth,
                interval * kInterval_s);
    last = T_world_camera;
    const auto drift = height->Drift();
    if (!corrected || !drift) continue;
    scale *= std::exp(-*drift);
    height->Correct(std::exp(-*drift));
  }
  return std::log(scale);
}

double DriveOn(double rate, bool corrected, CameraHeight* height) {
  return DriveOn([rate](std::size_t) { return rate; }, corrected, height);
}

TEST(CameraHeight, TellsNoDriftWhereThereIsNone) {
  CameraHeight height;
  DriveOn(0, false, &height);
  EXPECT_LT(std::abs(height.Drift().value_or(0)), 0.01);
}

// A road that bends up and down is seen steeper ahead than it is below the camera.
TEST(CameraHeight, TellsNoDriftOverHills) {
  SyntheticOptions options = LongTown().Options();
  options.hills_m = 8;
  const testing::RenderedWorld hills(options);
  CameraHeight height;
  Pose last = hills.World().PoseOf(0);
  for (std::size_t i = 0; i < kDriven; ++i) {
    const Pose now = hills.World().PoseOf(i);
    height.See(hills.Camera(), Features(hills.Render(i).image), now.Inverse(), last.Inverse(), kDepth,
               kInterval_s);
    last = now;
    EXPECT_LT(std::abs(height.Drift().value_or(0)), 0.03) << i;
  }
  EXPECT_GT(height.Found()->measurements, 100);
}

TEST(CameraHeight, TellsADriftAndItsSign) {
  for (const double rate : {0.0005, -0.0005}) {  // 8 % in all
    CameraHeight height;
    DriveOn(rate, false, &height);
    ASSERT_TRUE(height.Drift());
    EXPECT_GT(*height.Drift() / rate, 0.3 * kDriven);
    EXPECT_LT(*height.Drift() / rate, 1.2 * kDriven);
  }
}

TEST(CameraHeight, KeepsTheScaleWhereItsDriftIsTakenOut) {
  CameraHeight height;
  EXPECT_FALSE(height.Found());
  EXPECT_LT(std::abs(DriveOn(0.0005, true, &height)), 0.7 * 0.0005 * kDriven);
  ASSERT_TRUE(height.Found());
  EXPECT_GT(height.Found()->measurements, 100);
  EXPECT_GT(height.Found()->corrections, 0);
  EXPECT_LT(height.Found()->log_scale, 0);
  height.Forget();
  EXPECT_EQ(height.Found()->measurements, 0);
  EXPECT_GT(height.Found()->corrections, 0) << "what was done stays known";
}

// As where landmarks were taken for others: the scale is another one within five frames. It makes the camera
// faster as well as higher, so it is no camera that sinks.
TEST(CameraHeight, TakesAScaleThatJumpsForADrift) {
  CameraHeight height;
  const double jump = std::log(0.8);
  const auto rate = [&](std::size_t i) { return i >= 80 && i < 85 ? jump / 5 : 0; };
  EXPECT_LT(std::abs(DriveOn(rate, true, &height)), 0.4 * std::abs(jump));
  EXPECT_GT(height.Found()->measurements, 100) << "it did not begin anew";
}

// The frames come later by as much as the map gets smaller, and so the step of a frame stays what it was.
TEST(CameraHeight, ComparesSpeedsBySeconds) {
  CameraHeight height;
  const auto rate = [](std::size_t i) { return i >= 80 && i < 85 ? std::log(0.8) / 5 : 0; };
  const auto time = [](std::size_t i) {
    return i < 80 ? static_cast<double>(i) : 80 + 1.25 * static_cast<double>(i - 80);
  };
  EXPECT_LT(std::abs(DriveOn(rate, true, &height, time)), 0.4 * std::abs(std::log(0.8)));
  EXPECT_GT(height.Found()->measurements, 100) << "it did not begin anew";
}

// From every fourth frame the ground of the first image is below the second one, or nearly.
TEST(CameraHeight, IsSilentWhereTheStepIsTooLong) {
  CameraHeight height;
  DriveOn([](std::size_t) { return 0.002; }, false, &height,
          [](std::size_t i) { return 4 * static_cast<double>(i); });
  EXPECT_FALSE(height.Found()) << height.Found()->measurements;
}

TEST(CameraHeight, BelievesALoop) {
  CameraHeight height;
  DriveOn(0.0005, false, &height);
  const auto before = height.Drift();
  height.Rescale(0.9);
  EXPECT_EQ(height.Drift(), before) << "the map is right where a loop has moved it";
}

TEST(CameraHeight, SaysNothingBeforeAWallOrSnow) {
  CameraHeight height;
  cv::RNG random(1);
  for (int i = 0; i < 100; ++i) {
    cv::Mat snow(200, 400, CV_8U);
    random.fill(snow, cv::RNG::UNIFORM, 0, 255);
    const Pose now(Eigen::Quaterniond::Identity(), {0, 0, 0.8 * i}),
        last(Eigen::Quaterniond::Identity(), {0, 0, 0.8 * std::max(0, i - 1)});
    height.See(LongTown().Camera(), Features(snow), now.Inverse(), last.Inverse(), kDepth, kInterval_s);
  }
  EXPECT_FALSE(height.Drift());
}

// On a drone the height is what changes, and not the scale.
TEST(CameraHeight, SaysNothingOfACameraThatClimbs) {
  CameraHeight height;
  Pose last = PoseOf(0);
  for (std::size_t i = 0; i < 80; ++i) {
    Pose now = PoseOf(i);
    now.translation += 0.02 * static_cast<double>(i) * (now.rotation * Eigen::Vector3d(0, -1, 0));
    height.See(LongTown().Camera(), Features(LongTown().World().RenderFrom(i, now).image), now.Inverse(),
               last.Inverse(), kDepth, kInterval_s);
    last = now;
    EXPECT_LT(std::abs(height.Drift().value_or(0)), 0.03) << i;
  }
}

// A camera in a hand, or on a mast that is raised while the vehicle drives: by two fifths over this drive. No
// scale drifts so fast, so what was learnt is given up, and the height that is there is the one to keep.
TEST(CameraHeight, BeginsAnewWhereTheHeightChanges) {
  CameraHeight height;
  Pose last = PoseOf(0);
  int least = 1000;
  for (std::size_t i = 0; i < kDriven; ++i) {
    Pose now = PoseOf(i);
    const double way = static_cast<double>(i) / kDriven;
    now.translation += 0.7 * way * (now.rotation * Eigen::Vector3d(0, -1, 0));
    height.See(LongTown().Camera(), Features(LongTown().World().RenderFrom(i, now).image), now.Inverse(),
               last.Inverse(), kDepth, kInterval_s);
    last = now;
    if (i >= 60) least = std::min(least, height.Found() ? height.Found()->measurements : 0);
    EXPECT_LT(std::abs(height.Drift().value_or(0)), 0.12) << i << ": a third of it";
  }
  EXPECT_LT(least, 20);
}

TEST(CameraHeight, NeedsImages) {
  CameraHeight height;
  height.See(LongTown().Camera(), std::make_shared<FrameFeatures>(), Pose(), Pose(), kDepth, kInterval_s);
  EXPECT_FALSE(height.Drift());
}

}  // namespace
}  // namespace tutti
