// The pipeline as a class: what a closed loop does to the map, and to what comes after it.
#include "tutti/slam/slam_system.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <tuple>

#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::Recording;

// Twice round a small block.
const Recording& TwoLaps() {
  static const Recording recording = [] {
    SyntheticOptions options = testing::SmallStereoTown(320, 160);
    options.block_m = 20;
    options.laps = 2;
    const testing::RenderedWorld world(options);
    return testing::Record(world, world.Size());
  }();
  return recording;
}

// Of a run: what the tests vary.
struct Setting {
  bool global_adjustment = true;
  int threads = 1;
  double gate_sigmas = SlamOptions().loop_gate_sigmas;
  bool whole = true;  // both laps with the ensemble; else the loops of one member where the second lap begins

  bool operator<(const Setting& other) const {
    return std::tie(global_adjustment, threads, gate_sigmas, whole) <
           std::tie(other.global_adjustment, other.threads, other.gate_sigmas, other.whole);
  }
};

RunConfig SmallConfig(const Setting& setting) {
  RunConfig config;
  config.odometry.features = 800;
  config.run.global_adjustment = setting.global_adjustment;
  config.run.threads = setting.threads;
  config.run.loop_gate_sigmas = setting.gate_sigmas;
  if (!setting.whole) config.loops.members = {"orb"};
  return config;
}

struct Result {
  int adjustments = 0, corrections = 0;
  std::vector<double> keyframe_stamps;
  Trajectory trajectory;
  std::vector<Loop> loops;
  double ate_m = 0;
};

Result DriveOnce(const Setting& setting) {
  SlamSystem slam(SmallConfig(setting), TwoLaps().rig);
  const std::size_t all = TwoLaps().frames.size(), count = setting.whole ? all : all * 7 / 10;
  for (std::size_t i = 0; i < count; ++i) slam.Track(TwoLaps().frames[i]);
  slam.Finish();
  Result result;
  result.adjustments = slam.Report().global_adjustments;
  result.corrections = slam.Report().corrections;
  const Odometry& odometry = *slam.odometry();
  for (const int id : odometry.map().KeyframeIds())
    result.keyframe_stamps.push_back(odometry.map().keyframe(id).stamp_s);
  result.trajectory = FrameTrajectory(odometry.map());
  result.loops = slam.loops();
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kSE3;
  result.ate_m = EvaluateTrajectory(TwoLaps().truth, result.trajectory, options).ate.rmse;
  return result;
}

// Each once, however many tests look at it.
const Result& DriveThrough(const Setting& setting) {
  static std::map<Setting, Result> driven;
  const auto known = driven.find(setting);
  return known != driven.end() ? known->second : driven.emplace(setting, DriveOnce(setting)).first->second;
}

TEST(SlamSystem, ASecondLapNeedsFewKeyframesAndTheWholeMapIsAdjusted) {
  const Result &with = DriveThrough({true, 2}), &without = DriveThrough({false, 2});
  ASSERT_GT(with.corrections, 0);
  EXPECT_GT(with.adjustments, 0);
  EXPECT_EQ(without.adjustments, 0);
  // The last half of the second lap: the loop is closed long since.
  const double end = TwoLaps().truth.back().stamp_s;
  const auto between = [](const Result& r, double from, double to) {
    return std::count_if(r.keyframe_stamps.begin(), r.keyframe_stamps.end(),
                         [&](double t) { return t >= from && t < to; });
  };
  EXPECT_LT(4 * between(with, 0.75 * end, end), between(with, 0.25 * end, 0.5 * end));
  EXPECT_EQ(with.trajectory.size(), TwoLaps().frames.size());
  EXPECT_LE(with.ate_m, 1.01 * without.ate_m);  // its landmarks measure the loops of both
  std::printf("  ATE %.4f m, %.4f m without fusion and adjustment; %zu and %zu keyframes\n", with.ate_m,
              without.ate_m, with.keyframe_stamps.size(), without.keyframe_stamps.size());
}

// A keyframe without odometry edges would follow any loop, the false ones too.
TEST(SlamSystem, OdometryEdgesTieEveryKeyframeOfAMonoMapToTheOthers) {
  SyntheticOptions options = testing::SmallStereoTown(320, 160);
  options.sensor = SyntheticSensor::kMono;
  const Recording recording = testing::Record(testing::RenderedWorld(options), 40);
  SlamSystem slam(SmallConfig({true, 1}), recording.rig);
  for (const InputFrame& frame : recording.frames) slam.Track(frame);
  slam.Finish();
  const PoseGraph graph = slam.Graph();
  ASSERT_GT(graph.nodes().size(), 3u);
  std::set<NodeId> tied;
  for (const PoseGraphEdge& edge : graph.edges()) tied.insert({edge.from, edge.to});
  EXPECT_EQ(tied.size(), graph.nodes().size());
}

void ExpectTheSameBits(const Result& a, const Result& b) {
  EXPECT_EQ(a.adjustments, b.adjustments);
  EXPECT_EQ(a.corrections, b.corrections);
  ASSERT_EQ(a.trajectory.size(), b.trajectory.size());
  for (std::size_t i = 0; i < a.trajectory.size(); ++i)
    EXPECT_EQ(a.trajectory[i].pose.Matrix(), b.trajectory[i].pose.Matrix()) << i;
}

TEST(SlamSystem, WhatBackgroundWorkFindsDoesNotDependOnTheThreadsAndNothingIsRevokedWhereTheMapAgrees) {
  const Result &one = DriveThrough({true, 1}), &two = DriveThrough({true, 2});
  ExpectTheSameBits(one, two);
  ASSERT_GT(two.corrections, 0);
  for (const Loop& loop : two.loops) EXPECT_FALSE(loop.revoked) << loop.query;
}

TEST(SlamSystem, LoopsThatAreGatedDoNotDependOnTheThreads) {
  const Result &one = DriveThrough({false, 1, 20, false}), &ungated = DriveThrough({false, 2, 0, false});
  ExpectTheSameBits(one, DriveThrough({false, 2, 20, false}));
  ASSERT_GT(one.corrections, 0);
  EXPECT_EQ(one.corrections, ungated.corrections) << "the gate refuses no true loop";
  EXPECT_NEAR(one.ate_m, ungated.ate_m, 0.1 * ungated.ate_m);
}

// The gate's limit is so low that it refuses all: the detector hears of it, at the same image for any number
// of threads.
TEST(SlamSystem, TheDetectorIsToldOfLoopsThatTheMapContradicts) {
  const Result &one = DriveThrough({false, 1, 0.001, false}), &two = DriveThrough({false, 2, 0.001, false});
  const auto revoked = [](const Loop& loop) { return loop.revoked; };
  ASSERT_GT(std::count_if(one.loops.begin(), one.loops.end(), revoked), 0);
  for (const Loop& loop : one.loops) {
    EXPECT_FALSE(loop.revoked && loop.accepted()) << loop.query;
    EXPECT_EQ(loop.revoked, loop.gate_sigmas.has_value()) << loop.query << ": " << loop.reason;
  }
  EXPECT_EQ(one.corrections, 0);
  ExpectTheSameBits(one, two);
  ASSERT_EQ(one.loops.size(), two.loops.size());
  for (std::size_t i = 0; i < one.loops.size(); ++i) {
    EXPECT_EQ(one.loops[i].revoked, two.loops[i].revoked);
    EXPECT_EQ(one.loops[i].hypothesis, two.loops[i].hypothesis);
    EXPECT_EQ(one.loops[i].probability, two.loops[i].probability);
  }
}

TEST(SlamSystem, LoopsFromElsewhereNeedKeyframesThatAreThereAndFiniteNumbers) {
  SlamSystem slam(SmallConfig({true, 1}), TwoLaps().rig);
  for (std::size_t i = 0; i < 20; ++i) slam.Track(TwoLaps().frames[i]);
  const Matrix7d information = MakeInformation(0.1, 0.1);
  Similarity nowhere;
  nowhere.translation.x() = std::nan("");
  EXPECT_THROW(slam.AddLoop(0, 1000, Similarity(), information), InputError);
  EXPECT_THROW(slam.AddLoop(-1, 1, Similarity(), information), InputError);
  EXPECT_THROW(slam.AddLoop(1, 0, Similarity(), information), InputError);
  EXPECT_THROW(slam.AddLoop(0, 1, nowhere, information), InputError);
  EXPECT_TRUE(slam.loops().empty());
}

TEST(SlamSystem, ImagesOfAnotherKindAreRefusedAndTheNextFrameIsTracked) {
  SlamSystem slam(SmallConfig({true, 1}), TwoLaps().rig);
  const auto refused = [&](const std::function<void(InputFrame&)>& spoil) {
    InputFrame frame = TwoLaps().frames[1];
    frame.features.reset();
    spoil(frame);
    EXPECT_THROW(slam.Track(frame), InputError);
    EXPECT_THROW(slam.Follow(frame, Pose()), InputError);
  };
  slam.Track(TwoLaps().frames[0]);
  const cv::Size size = TwoLaps().frames[0].image.size();
  for (const int type : {CV_32FC1, CV_8UC(128), CV_8UC3, CV_16UC1})
    refused([&](InputFrame& frame) { frame.image = cv::Mat::zeros(size, type); });
  refused([](InputFrame& frame) { frame.image = cv::Mat(); });
  refused([](InputFrame& frame) { frame.image = frame.image.colRange(0, 100); });
  refused([&](InputFrame& frame) { frame.right = cv::Mat::zeros(size, CV_32FC1); });
  refused([](InputFrame& frame) { frame.right = frame.right.rowRange(0, 10); });
  refused([&](InputFrame& frame) { frame.depth_m = cv::Mat::zeros(size, CV_16UC1); });
  refused([&](InputFrame& frame) { frame.mask = cv::Mat::zeros(size, CV_8UC3); });
  EXPECT_EQ(slam.Track(TwoLaps().frames[1]).state, TrackingState::kTracking);
  EXPECT_EQ(slam.Sessions().back().frames, 2) << "what was refused is no frame";
}

TEST(SlamSystem, AnOdometryOfItsOwnIsAsUncertainAsConfigured) {
  const testing::RenderedWorld world(testing::SmallStereoTown(320, 160));
  const testing::Recording town = testing::Record(world, 3);
  for (const double deg : {0.1, 0.21, 0.42}) {
    RunConfig config = SmallConfig({true, 1});
    config.run.odometry_sigma_deg = deg;
    SlamSystem slam(config, town.rig);
    for (const InputFrame& frame : town.frames) slam.Track(frame);
    slam.Finish();
    EXPECT_TRUE(slam.TakeWarnings().empty()) << deg;
  }
}

}  // namespace
}  // namespace tutti
