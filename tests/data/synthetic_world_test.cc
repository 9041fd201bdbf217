#include "data/synthetic/synthetic_world.h"

#include <gtest/gtest.h>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/byte_stream.h"
#include "data/synthetic/image_change.h"
#include "gmock/gmock.h"
#include "tests/data/small_world.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::SmallWorld;

// True if an image shows a grey level between its pixels, within 12.
bool Shows(const cv::Mat& image, const Eigen::Vector2d& at, int grey) {
  cv::Mat patch;
  cv::getRectSubPix(image, {1, 1}, cv::Point2f(static_cast<float>(at.x()), static_cast<float>(at.y())),
                    patch);
  return std::abs(patch.at<unsigned char>(0, 0) - grey) <= 12;
}

// The mean absolute difference per pixel.
double MeanDifference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total());
}

// Fraction of pixels of image a, moved into image b by depth and poses, that show what a shows,
// among those that are not hidden there.
double AgreementByWarp(const SyntheticWorld& world, std::size_t a, std::size_t b, double* compared) {
  const cv::Mat image_a = world.Render(a).image, image_b = world.Render(b).image;
  const cv::Mat depth_a = world.ExactDepth(a), depth_b = world.ExactDepth(b);
  const Pose T_b_a = world.PoseOf(b).Inverse() * world.PoseOf(a);
  int seen = 0, equal = 0;
  for (int v = 4; v < image_a.rows - 4; v += 2) {
    for (int u = 4; u < image_a.cols - 4; u += 2) {
      const double z = depth_a.at<float>(v, u);
      if (z <= 0 || z > 60) continue;
      const Eigen::Vector3d p = T_b_a * (z * world.Camera().Unproject({u, v}));
      if (p.z() < 0.1) continue;
      const Eigen::Vector2d q = world.Camera().Project(p);
      if (!world.Camera().Contains(q, 2)) continue;
      const int x = static_cast<int>(std::lround(q.x())), y = static_cast<int>(std::lround(q.y()));
      if (std::abs(depth_b.at<float>(y, x) - p.z()) > 0.05 * p.z()) continue;
      ++seen;
      equal += Shows(image_b, q, image_a.at<unsigned char>(v, u)) ? 1 : 0;
    }
  }
  *compared = seen;
  return static_cast<double>(equal) / std::max(seen, 1);
}

TEST(SyntheticWorldTest, GroundTruthAndDepthExplainTheImages) {
  for (const SyntheticScene scene : {SyntheticScene::kTown, SyntheticScene::kRoom}) {
    const SyntheticWorld world(SmallWorld(scene, SyntheticSensor::kRgbd));
    double compared = 0;
    for (const std::size_t i : {3U, 40U}) {
      EXPECT_GT(AgreementByWarp(world, i, i + 3, &compared), 0.9) << i;
      EXPECT_GT(compared, 2000);
    }
  }
}

TEST(SyntheticWorldTest, RightImageIsTheLeftOneMovedByItsDisparity) {
  const SyntheticWorld world(SmallWorld(SyntheticScene::kTown, SyntheticSensor::kStereo));
  const SyntheticFrame frame = world.Render(5);
  const cv::Mat depth = world.ExactDepth(5);
  int seen = 0, equal = 0;
  for (int v = 2; v < frame.image.rows - 2; v += 2) {
    for (int u = 60; u < frame.image.cols - 2; u += 2) {
      const double z = depth.at<float>(v, u);
      if (z <= 0 || z > 40) continue;
      const double x = u - world.Camera().fx * world.Options().baseline_m / z;
      if (x < 1) continue;
      ++seen;
      equal += Shows(frame.right, {x, v}, frame.image.at<unsigned char>(v, u)) ? 1 : 0;
    }
  }
  EXPECT_GT(seen, 2000);
  EXPECT_GT(equal, 0.88 * seen);  // the rest is hidden from the right camera
}

TEST(SyntheticWorldTest, EveryViewHasCornersToTrack) {
  for (const SyntheticScene scene : {SyntheticScene::kTown, SyntheticScene::kRoom}) {
    SyntheticOptions options = SmallWorld(scene, SyntheticSensor::kMono);
    options.width = 640;
    options.height = scene == SyntheticScene::kTown ? 320 : 480;
    const SyntheticWorld world(options);
    const std::size_t lap = world.FramesPerLap();
    for (std::size_t i = 0; i < lap; i += lap / 12) {
      std::vector<cv::KeyPoint> keypoints;
      cv::FAST(world.Render(i).image, keypoints, 15);
      EXPECT_GT(keypoints.size(), 300U) << "scene " << static_cast<int>(scene) << " frame " << i;
    }
  }
}

TEST(SyntheticWorldTest, MotionIsSmoothAndTheSecondLapRevisitsTheFirst) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kTown, SyntheticSensor::kMono);
  options.laps = 2;
  const SyntheticWorld world(options);
  const Trajectory truth = world.GroundTruth();
  EXPECT_TRUE(truth[0].pose.translation.isZero());
  for (std::size_t i = 1; i < truth.size(); ++i) {
    const Pose step = truth[i - 1].pose.Inverse() * truth[i].pose;
    ASSERT_LT(step.translation.norm(), 0.85);
    ASSERT_LT(step.Angle() * 57.3, 4.0);
  }
  const std::size_t lap = world.FramesPerLap();
  double nearest = 1e9;
  for (std::size_t i = lap; i < std::min(lap + 10, truth.size()); ++i)
    nearest = std::min(nearest, truth[i].pose.translation.norm());
  EXPECT_LT(nearest, 1.5);
  EXPECT_GT(nearest, 0.02);  // but not in the same tracks
}

TEST(SyntheticWorldTest, SameSeedSameBytesOtherSeedOtherTown) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kTown, SyntheticSensor::kMono);
  options.noise_sigma = 4;
  const cv::Mat one = SyntheticWorld(options).Render(7).image, two = SyntheticWorld(options).Render(7).image;
  EXPECT_EQ(cv::norm(one, two, cv::NORM_INF), 0);
  options.seed = 2;
  EXPECT_GT(MeanDifference(one, SyntheticWorld(options).Render(7).image), 5);
}

TEST(SyntheticWorldTest, NoiseBlurLightAndMovingObjectsChangeTheImages) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kTown, SyntheticSensor::kRgbd);
  options.laps = 1.3;
  const SyntheticWorld plain(options);
  const std::size_t late = plain.FramesPerLap() + 45;  // second lap, cloud complete
  ASSERT_LT(late, plain.Size());
  const auto difference = [&](const SyntheticOptions& o, std::size_t i) {
    return MeanDifference(SyntheticWorld(o).Render(i).image, plain.Render(i).image);
  };
  SyntheticOptions other = options;
  other.noise_sigma = 5;
  EXPECT_NEAR(difference(other, 3), 5 * 0.8, 0.8);  // mean absolute value of a normal: 0.8 sigma
  other = options;
  other.motion_blur_s = 0.04;
  EXPECT_GT(difference(other, 30), 0.5);
  other = options;
  other.lighting_change = true;
  EXPECT_EQ(difference(other, 3), 0);
  EXPECT_GT(difference(other, late), 15);
  other = options;
  other.moving_objects = 12;
  double moved = 0;
  for (const std::size_t i : {3U, 20U, 40U}) moved = std::max(moved, difference(other, i));
  EXPECT_GT(moved, 0.2);
}

// Mean grey level of each of 4x2 parts of an image.
std::vector<double> Tones(const cv::Mat& image) {
  cv::Mat grid;
  cv::resize(image, grid, {4, 2}, 0, 0, cv::INTER_AREA);
  return {grid.begin<unsigned char>(), grid.end<unsigned char>()};
}

SyntheticOptions SmallTwoLaps() {
  SyntheticOptions o = SmallWorld(SyntheticScene::kTown, SyntheticSensor::kStereo);
  o.laps = 2;
  o.supersample = 1;
  o.noise_sigma = 2;
  return o;
}

bool SameImages(const SyntheticFrame& a, const SyntheticFrame& b) {
  return cv::norm(a.image, b.image, cv::NORM_INF) == 0 && cv::norm(a.right, b.right, cv::NORM_INF) == 0;
}

TEST(SyntheticWorldTest, WorldsLookAsTheyAlwaysDid) {
  const std::pair<SyntheticScene, std::vector<double>> looks[] = {
      {SyntheticScene::kTown, {131, 173, 132, 82, 92, 101, 96, 102}},
      {SyntheticScene::kRoom, {169, 152, 129, 136, 145, 129, 126, 126}},
      {SyntheticScene::kCorridor, {164, 169, 163, 134, 156, 137, 129, 124}}};
  for (const auto& [scene, tones] : looks) {
    EXPECT_THAT(Tones(SyntheticWorld(SmallWorld(scene, SyntheticSensor::kMono)).Render(7).image),
                ::testing::Pointwise(::testing::DoubleNear(1.01), tones));
  }
}

std::uint32_t Checksum(const cv::Mat& image) {
  return internal::Crc32({image.ptr<char>(), image.total() * image.elemSize()});
}

// Whole images, so that nothing is drawn in another order: neither by another compiler nor after a change.
TEST(SyntheticWorldTest, ImagesAreTheSameBytesWithEveryCompiler) {
#if CV_VERSION_MAJOR != 4 || CV_VERSION_MINOR != 6
  GTEST_SKIP() << "the checksums are those of OpenCV 4.6; others draw and scale in other ways";
#elif !defined(__x86_64__) || defined(__FMA__)
  GTEST_SKIP() << "the checksums are those of x86-64 without fused multiply-add";
#endif
  const auto checksum = [](const SyntheticOptions& o, std::size_t i) {
    return Checksum(SyntheticWorld(o).Render(i).image);
  };
  SyntheticOptions town = SmallWorld(SyntheticScene::kTown, SyntheticSensor::kMono);
  EXPECT_EQ(checksum(town, 7), 1569755144U);
  EXPECT_EQ(checksum(SmallWorld(SyntheticScene::kRoom, SyntheticSensor::kMono), 7), 3208442277U);
  EXPECT_EQ(checksum(SmallWorld(SyntheticScene::kCorridor, SyntheticSensor::kMono), 7), 2192339742U);
  town.laps = 2;
  town.dusk = town.other_cars = true;
  town.occlusion = 0.3;
  town.noise_sigma = 4;
  town.moving_objects = 6;
  EXPECT_EQ(checksum(town, SyntheticWorld(town).FramesPerLap() + 90), 1711598673U);
  const cv::Mat grey(240, 320, CV_8UC1, cv::Scalar(120));
  EXPECT_EQ(Checksum(ImageChange::Parse("rain:2").Apply(grey, 1, 3)), 2398972044U);
  EXPECT_EQ(Checksum(ImageChange::Parse("occluded:2").Apply(grey, 1, 3)), 3507768232U);
}

TEST(SyntheticWorldTest, OnlyTheSecondLapIsAtDuskOrOccludedAndThePosesStay) {
  const SyntheticWorld plain(SmallTwoLaps());
  const std::size_t lap = plain.FramesPerLap(), late = lap + 60;
  SyntheticOptions dusk = SmallTwoLaps(), occluded = SmallTwoLaps();
  dusk.dusk = true;
  occluded.occlusion = 0.3;
  for (const SyntheticOptions& options : {dusk, occluded}) {
    const SyntheticWorld world(options);
    ASSERT_EQ(world.Size(), plain.Size());
    for (const std::size_t i : {std::size_t{0}, std::size_t{30}, lap - 1})
      EXPECT_TRUE(SameImages(world.Render(i), plain.Render(i))) << i;
    EXPECT_FALSE(SameImages(world.Render(late), plain.Render(late)));
    EXPECT_TRUE(SameImages(world.Render(late), SyntheticWorld(options).Render(late)));
    EXPECT_EQ(world.PoseOf(late).translation, plain.PoseOf(late).translation);
  }
  const cv::Mat at_dusk = SyntheticWorld(dusk).Render(late).image, by_day = plain.Render(late).image;
  EXPECT_LT(cv::mean(at_dusk)[0], 0.45 * cv::mean(by_day)[0]);
}

TEST(SyntheticWorldTest, LorriesCoverAboutThePartOfTheImageThatWasAskedFor) {
  const SyntheticWorld plain(SmallTwoLaps());
  for (const double part : {0.1, 0.2, 0.3}) {
    SyntheticOptions options = SmallTwoLaps();
    options.occlusion = part;
    const SyntheticWorld world(options);
    double covered = 0;
    int frames = 0;
    for (std::size_t i = plain.FramesPerLap() + 60; i < plain.Size(); i += 7, ++frames) {
      const cv::Mat with = world.ExactDepth(i), without = plain.ExactDepth(i);
      covered +=
          static_cast<double>(cv::countNonZero(with < 0.98 * without)) / static_cast<double>(with.total());
    }
    EXPECT_NEAR(covered / frames, part, 0.05) << part;
  }
}

TEST(SyntheticWorldTest, OtherCarsAreParkedWhenAPlaceIsSeenAgain) {
  const SyntheticWorld plain(SmallTwoLaps());
  SyntheticOptions options = SmallTwoLaps();
  options.other_cars = true;
  const SyntheticWorld world(options);
  const std::size_t lap = plain.FramesPerLap();
  for (std::size_t i = 0; i < lap / 3; i += 10)
    EXPECT_TRUE(SameImages(world.Render(i), plain.Render(i))) << i;
  int changed = 0, frames = 0;
  for (std::size_t i = lap; i < plain.Size(); i += 10, ++frames)
    changed += SameImages(world.Render(i), plain.Render(i)) ? 0 : 1;
  EXPECT_GT(changed, 0.8 * frames);
}

// The road is as far below the camera on a slope as on flat ground, and is seen as there.
TEST(SyntheticWorldTest, StreetsGoUpAndDownHills) {
  SyntheticOptions options = SmallTwoLaps();
  options.hills_m = 4;
  const SyntheticWorld world(options);
  double low = 0, high = 0;
  for (std::size_t i = 0; i < world.FramesPerLap(); ++i) {
    const double up = -world.PoseOf(i).translation.y();  // of the first camera, which is nearly level
    low = std::min(low, up);
    high = std::max(high, up);
  }
  EXPECT_GT(high - low, 3);
  EXPECT_LT(high - low, 14);
  options.hills_m = 0;
  const SyntheticWorld flat(options);
  const PinholeCamera& camera = world.Camera();
  const int row = camera.height - 6;
  const auto height = [&](const SyntheticWorld& seen, std::size_t i) {
    return seen.ExactDepth(i).at<float>(row, camera.width / 2) * (row - camera.cy) / camera.fy;
  };
  for (std::size_t i = 0; i < world.FramesPerLap(); i += 40)
    EXPECT_NEAR(height(world, i), height(flat, i), 0.08) << i;
}

TEST(SyntheticWorldTest, TheCameraLooksDownOrUp) {
  SyntheticOptions options = SmallTwoLaps();
  const SyntheticWorld level(options);
  options.pitch_deg = 20;
  const SyntheticWorld down(options);
  const auto middle = [](const SyntheticWorld& world) {
    return world.ExactDepth(5).at<float>(world.Camera().height / 2, world.Camera().width / 2);
  };
  EXPECT_NEAR(middle(down), 1.65 / std::sin(20 * M_PI / 180), 0.4);
  EXPECT_GT(middle(level), 3 * middle(down));
  options.pitch_deg = 60;
  EXPECT_NE(options.Validate(), "");
}

TEST(SyntheticWorldTest, KinectNoiseGrowsWithDepthAndLeavesHoles) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kRoom, SyntheticSensor::kRgbd);
  options.kinect_noise = true;
  const SyntheticWorld world(options);
  const cv::Mat noisy = world.Render(3).depth_m, exact = world.ExactDepth(3);
  const double holes = static_cast<double>(cv::countNonZero(noisy == 0)) / static_cast<double>(noisy.total());
  EXPECT_GT(holes, 0.003);
  EXPECT_LT(holes, 0.3);
  cv::Mat error;
  cv::absdiff(noisy, exact, error);
  EXPECT_NEAR(cv::mean(error, noisy > 0)[0], 0.007, 0.006);
}

TEST(SyntheticWorldTest, ARoomBehindCurtainsHasLittleToSee) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kRoom, SyntheticSensor::kMono);
  const auto edges = [&](double bare) {
    options.bare_fraction = bare;
    const SyntheticWorld world(options);
    double sum = 0;
    for (std::size_t i = 0; i < world.FramesPerLap(); i += world.FramesPerLap() / 8) {
      cv::Mat detail;
      cv::Laplacian(world.Render(i).image, detail, CV_32F);
      sum += cv::norm(detail, cv::NORM_L1) / static_cast<double>(detail.total());
    }
    return sum;
  };
  const double furnished = edges(0);
  EXPECT_LT(edges(0.5), 0.8 * furnished);
  EXPECT_LT(edges(1), 0.5 * furnished);
}

TEST(SyntheticWorldTest, APlainDoorFillsTheViewFromNearby) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kRoom, SyntheticSensor::kRgbd);
  options.plain_doors = 2;
  options.laps = 1;
  const SyntheticWorld world(options);
  double nearest = 100;
  std::size_t filled = 0;
  for (std::size_t i = 0; i < world.Size(); ++i) {
    double least = 0, most = 0;
    cv::minMaxLoc(world.ExactDepth(i), &least, &most);
    nearest = std::min(nearest, least);
    if (most < 2) ++filled;
  }
  EXPECT_GT(nearest, 0.15);
  EXPECT_LT(nearest, 0.45);
  EXPECT_GE(filled, 5u);
}

// Every row of a shaken camera with a rolling shutter is that of a still camera at the row's time.
TEST(SyntheticWorldTest, RowsOfARollingShutterAreSeenFromWhereTheCameraIsThen) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kRoom, SyntheticSensor::kRgbd);
  options.supersample = 1;
  options.rate_hz = 30;
  options.shake_deg_per_s = 200;
  options.readout_s = 0.03;
  const SyntheticWorld world(options);
  const std::size_t i = 60;
  const SyntheticFrame rolling = world.Render(i), global = world.RenderFrom(i, world.PoseOf(i));
  EXPECT_GT(MeanDifference(rolling.image, global.image), 5);
  for (const int first : {0, 60, 120, 236}) {
    const double late = options.readout_s * ((first + 1.5) / 239 - 0.5);
    const SyntheticFrame then = world.RenderFrom(i, world.PoseAt(world.Stamp(i) + late));
    // Edges between pixels fall to either side.
    for (const auto& [a, b] : {std::pair{rolling.image, then.image}, {rolling.depth_m, then.depth_m}})
      EXPECT_LT(MeanDifference(a.rowRange(first, first + 4), b.rowRange(first, first + 4)), 0.3) << first;
  }
}

TEST(SyntheticWorldTest, TheCorridorHasLittleToSeeAndIsWalkedAgain) {
  SyntheticOptions options;
  options.scene = SyntheticScene::kCorridor;
  options.width = 240;
  options.height = 192;
  options.rate_hz = 1;
  options.laps = 2;
  const SyntheticWorld world(options);
  EXPECT_NEAR(world.LapLength(), 3 * options.corridor_m, 0.05 * 3 * options.corridor_m);
  const std::size_t lap = world.FramesPerLap();
  int corners = 0;
  for (std::size_t i = 0; i < lap; i += lap / 10) {
    const SyntheticFrame frame = world.Render(i);
    double darkest = 0, brightest = 0;
    cv::minMaxLoc(frame.image, &darkest, &brightest);
    EXPECT_GT(brightest - darkest, 25) << i;  // even a corner is not blank
    std::vector<cv::KeyPoint> keypoints;
    cv::FAST(frame.image, keypoints, 15);
    corners += static_cast<int>(keypoints.size());
  }
  EXPECT_LT(corners / 10, 300);  // what every view of town and room has more of
  double nearest = 1e9;
  for (std::size_t i = lap; i < lap + 3; ++i)
    nearest = std::min(nearest, (world.PoseOf(i).translation - world.PoseOf(0).translation).norm());
  EXPECT_LT(nearest, 1.0);
}

TEST(SyntheticWorldTest, BadOptionsAreNamed) {
  SyntheticOptions options;
  options.laps = -1;
  EXPECT_THROW(SyntheticWorld{options}, InputError);
  options.laps = 1;
  options.width = 640;  // without a height
  EXPECT_THAT(options.Validate(), ::testing::HasSubstr("height"));
  options = {};
  options.occlusion = 0.7;
  EXPECT_THAT(options.Validate(), ::testing::HasSubstr("occlusion"));
  options.occlusion = 0.3;
  options.scene = SyntheticScene::kRoom;
  EXPECT_THAT(options.Validate(), ::testing::HasSubstr("town"));
}

}  // namespace
}  // namespace tutti
