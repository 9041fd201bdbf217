// Loop closure around an odometry that somebody else has: truth with a random walk on it.
#include "tutti/slam/trajectory_closer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/disturbed.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tutti/core/error.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

using testing::Recording;

// Each once, however many tests drive through it.
const Recording& RecordedTown(SyntheticSensor sensor) {
  static std::map<SyntheticSensor, Recording> recorded;
  const auto known = recorded.find(sensor);
  if (known != recorded.end()) return known->second;
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.sensor = sensor;
  if (sensor == SyntheticSensor::kMono) options.rate_hz = 9;
  const testing::RenderedWorld world(options);
  return recorded.emplace(sensor, testing::Record(world, world.Size())).first->second;
}

RunConfig Small(int threads) {
  RunConfig config;
  config.odometry.features = 800;
  config.run.threads = threads;
  return config;
}

struct Closed {
  double drift_before = 0, drift_after = 0;
  std::size_t keyframes = 0, loops = 0;
  int corrections = 0;
  Pose T_map_odom;
  Trajectory trajectory;
  PoseGraph graph;
  std::vector<std::string> warnings, warnings_taken_again;
};

Closed CloseTown(const Recording& town, const Trajectory& odometry, const RunConfig& config) {
  TrajectoryCloser closer(config, town.rig);
  for (std::size_t i = 0; i < town.frames.size(); ++i) closer.Push(town.frames[i], odometry[i].pose);
  closer.Finish();
  Closed closed;
  closed.trajectory = closer.Corrected(odometry);
  closed.drift_before = testing::DriftAtTheEnd(town.truth, odometry);
  closed.drift_after = testing::DriftAtTheEnd(town.truth, closed.trajectory);
  closed.keyframes = closer.Keyframes().size();
  closed.loops = CountAccepted(closer.Loops());
  closed.corrections = closer.Corrections();
  closed.T_map_odom = closer.T_map_odom();
  closed.graph = closer.Graph();
  closed.warnings = closer.TakeWarnings();
  closed.warnings_taken_again = closer.TakeWarnings();
  std::printf("  %zu keyframes, %zu loops, %d corrections; drift %.3f m, then %.3f m\n", closed.keyframes,
              closed.loops, closed.corrections, closed.drift_before, closed.drift_after);
  return closed;
}

// An odometry that drifts, closed by two threads.
struct Drifting {
  Trajectory odometry;
  Closed closed;

  Drifting(SyntheticSensor sensor, double yaw_deg, double scale_percent)
      : odometry(testing::Disturbed(RecordedTown(sensor).truth, yaw_deg, scale_percent, 3)),
        closed(CloseTown(RecordedTown(sensor), odometry, Small(2))) {}
};

// One that is good enough for its loops, and one that is not: each closed once for all tests.
const Drifting& GoodStereo() {
  static const Drifting drifting(SyntheticSensor::kStereo, 0.5, 0.2);
  return drifting;
}
const Drifting& BadStereo() {
  static const Drifting drifting(SyntheticSensor::kStereo, 1.5, 1);
  return drifting;
}

void ExpectTheDriftIsGone(SyntheticSensor sensor, const Closed& closed) {
  EXPECT_GT(closed.corrections, 0);
  EXPECT_LT(closed.drift_after, 0.2 * closed.drift_before);
  EXPECT_EQ(closed.trajectory.size(), RecordedTown(sensor).truth.size());
}

TEST(TrajectoryCloser, StereoRemovesTheDriftOfTheOdometry) {
  ExpectTheDriftIsGone(SyntheticSensor::kStereo, GoodStereo().closed);
}
TEST(TrajectoryCloser, DepthImagesRemoveTheDriftOfTheOdometry) {
  ExpectTheDriftIsGone(SyntheticSensor::kRgbd, Drifting(SyntheticSensor::kRgbd, 0.5, 0.2).closed);
}
TEST(TrajectoryCloser, OneCameraTakesItsScaleFromTheOdometry) {
  ExpectTheDriftIsGone(SyntheticSensor::kMono, Drifting(SyntheticSensor::kMono, 0.1, 0.2).closed);
}

// A pair with common landmarks stands where the odometry put it: an edge would count its steps twice.
TEST(TrajectoryCloser, WhatTheOdometrySaysIsInTheGraphOnce) {
  const Closed& closed = GoodStereo().closed;
  std::size_t steps = 0;
  for (const PoseGraphEdge& edge : closed.graph.edges()) {
    if (edge.kind == EdgeKind::kLoop) continue;
    EXPECT_EQ(edge.to, edge.from + 1);
    ++steps;
  }
  EXPECT_EQ(steps, closed.keyframes - 1);
  EXPECT_EQ(closed.graph.edges().size(), steps + closed.loops);
}

TEST(TrajectoryCloser, TheImagesTellThatAnOdometryIsBadAndTrueLoopsEnterThen) {
  const Closed& closed = BadStereo().closed;
  ASSERT_EQ(closed.warnings.size(), 1u);
  EXPECT_NE(closed.warnings[0].find("the images contradict the odometry"), std::string::npos)
      << closed.warnings[0];
  EXPECT_TRUE(closed.warnings_taken_again.empty());
  EXPECT_LT(closed.drift_after, 0.2 * closed.drift_before);
}

// The odometry is far worse than images are: it gives way to them where that is asked for.
TEST(TrajectoryCloser, ABadOdometryIsAdjustedToTheImagesWhereAsked) {
  const Recording& town = RecordedTown(SyntheticSensor::kStereo);
  RunConfig config = Small(2);
  config.run.adjust_given = true;
  const Closed adjusted = CloseTown(town, BadStereo().odometry, config);
  EXPECT_LT(adjusted.drift_after, BadStereo().closed.drift_after);
  EXPECT_LT(adjusted.drift_after, 0.01 * adjusted.drift_before);
  EXPECT_EQ(adjusted.trajectory.size(), town.truth.size());
}

// An odometry that is good but for one slip of its heading, and knows when that was.
TEST(TrajectoryCloser, ALoopBendsTheTrajectoryWhereTheOdometryIsUncertain) {
  const Recording& town = RecordedTown(SyntheticSensor::kStereo);
  const std::size_t slip = town.truth.size() / 2;
  Trajectory odometry = town.truth;
  const Pose turned(ExpSO3({0, 0.1, 0}), Eigen::Vector3d::Zero());  // about 6 degrees
  for (std::size_t i = slip; i < odometry.size(); ++i)
    odometry[i].pose =
        town.truth[slip - 1].pose * turned * town.truth[slip - 1].pose.Inverse() * town.truth[i].pose;
  const auto error = [&](bool told) {
    RunConfig config = Small(2);
    config.loops.members = {"orb"};  // who finds the loops makes no difference here, but to the time
    TrajectoryCloser closer(config, town.rig);
    for (std::size_t i = 0; i < town.frames.size(); ++i) {
      std::optional<MotionSigma> sigma;
      if (told) sigma = i == slip ? MotionSigma{0.02, 0.1} : MotionSigma{0.002, 0.0002};
      closer.Push(town.frames[i], odometry[i].pose, sigma);
    }
    closer.Finish();
    EXPECT_GT(closer.Corrections(), 0);
    const Trajectory corrected = closer.Corrected(odometry);
    double worst = 0;
    for (std::size_t i = 0; i < corrected.size(); ++i)
      worst = std::max(worst, (corrected[i].pose.translation - town.truth[i].pose.translation).norm());
    return worst;
  };
  const double told = error(true), untold = error(false);
  std::printf("  farthest from the truth: %.3f m, %.3f m if it does not say\n", told, untold);
  EXPECT_LT(told, 0.7 * untold);
  EXPECT_LT(untold, 0.4) << "the images tell of the slip; 0.8 without them";
}

// The good stereo odometry with this done to its pose i; without threads and other members than ORB.
Closed CloseSpoilt(const std::function<void(std::size_t i, Pose* pose)>& spoil) {
  Trajectory odometry = GoodStereo().odometry;
  for (std::size_t i = 0; i < odometry.size(); ++i) spoil(i, &odometry[i].pose);
  RunConfig config = Small(2);
  config.loops.members = {"orb"};
  return CloseTown(RecordedTown(SyntheticSensor::kStereo), odometry, config);
}

bool Warned(const Closed& closed, const std::string& words) {
  return std::any_of(closed.warnings.begin(), closed.warnings.end(),
                     [&](const std::string& warning) { return warning.find(words) != std::string::npos; });
}

TEST(TrajectoryCloser, PosesThatAreOffMoveNoOthersAndAreSaid) {
  const Trajectory& truth = RecordedTown(SyntheticSensor::kStereo).truth;
  const Closed good = CloseSpoilt([](std::size_t, Pose*) {});
  const std::size_t middle = truth.size() / 2;
  const Closed closed = CloseSpoilt([&](std::size_t i, Pose* pose) {
    if (i == 0 || i == middle || i == middle + 1) pose->translation.x() += 1e10;
  });
  EXPECT_GT(closed.corrections, 0);
  for (std::size_t i = 1; i < truth.size(); ++i)
    EXPECT_LT((closed.trajectory[i].pose.translation - good.trajectory[i].pose.translation).norm(), 1) << i;
  // Before the first good pose nothing says how it moved.
  EXPECT_EQ(closed.trajectory[0].pose.translation, closed.trajectory[1].pose.translation);
  EXPECT_TRUE(Warned(closed, "its poses before that are replaced"));
  EXPECT_TRUE(Warned(closed, "and back between"));
}

TEST(TrajectoryCloser, LoopsJoinWhatAnOdometryThatBeganAnewTakesApart) {
  const Recording& town = RecordedTown(SyntheticSensor::kStereo);
  const std::size_t restart = 2 * town.truth.size() / 3;
  const Pose T_restart_world = GoodStereo().odometry[restart].pose.Inverse();
  const Closed closed = CloseSpoilt([&](std::size_t i, Pose* pose) {
    if (i >= restart) *pose = T_restart_world * *pose;
  });
  EXPECT_TRUE(Warned(closed, "this step has no weight"));
  EXPECT_GT(closed.drift_before, 5);
  EXPECT_LT(closed.drift_after, 0.3);
}

TEST(TrajectoryCloser, AnOdometryThatItsLoopsDoNotContradictStaysAsItIs) {
  const Recording& town = RecordedTown(SyntheticSensor::kStereo);
  const Closed closed = CloseTown(town, town.truth, Small(2));
  EXPECT_GT(closed.loops, 0u);
  EXPECT_EQ(closed.corrections, 0);
  ASSERT_EQ(closed.trajectory.size(), town.truth.size());
  for (std::size_t i = 0; i < town.truth.size(); ++i) {
    EXPECT_EQ(closed.trajectory[i].pose.translation, town.truth[i].pose.translation) << i;
    EXPECT_EQ(closed.trajectory[i].pose.rotation.coeffs(), town.truth[i].pose.rotation.coeffs()) << i;
  }
  EXPECT_LT(closed.T_map_odom.translation.norm(), 1e-9);
}

TEST(TrajectoryCloser, TheCorrectionMapsTheNewestPoseOfTheOdometry) {
  const auto& [odometry, closed] = GoodStereo();
  const Pose by_map = closed.T_map_odom * odometry.back().pose;
  EXPECT_LT((by_map.translation - closed.trajectory.back().pose.translation).norm(), 0.05);
  EXPECT_GT((closed.T_map_odom * odometry.back().pose.translation - odometry.back().pose.translation).norm(),
            0.1);
}

TEST(TrajectoryCloser, ThreadsChangeNothing) {
  const auto& [odometry, two] = GoodStereo();
  const Closed one = CloseTown(RecordedTown(SyntheticSensor::kStereo), odometry, Small(1));
  ASSERT_EQ(one.trajectory.size(), two.trajectory.size());
  for (std::size_t i = 0; i < one.trajectory.size(); ++i) {
    EXPECT_EQ(one.trajectory[i].pose.translation, two.trajectory[i].pose.translation) << i;
    EXPECT_EQ(one.trajectory[i].pose.rotation.coeffs(), two.trajectory[i].pose.rotation.coeffs()) << i;
  }
}

TEST(TrajectoryCloser, RefusesPosesThatAreNotFiniteAndTimesThatDoNotGrow) {
  const Recording town = [] {
    const testing::RenderedWorld world(testing::SmallStereoTown(320, 160));
    return testing::Record(world, 2);
  }();
  TrajectoryCloser closer(Small(1), town.rig);
  Pose bad;
  bad.translation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(closer.Push(town.frames[0], bad), InputError);
  EXPECT_THROW(closer.Push(town.frames[0], Pose(), MotionSigma{-1, 0}), InputError);
  EXPECT_THROW(closer.Push(town.frames[0], Pose(), MotionSigma{0, bad.translation.x()}), InputError);
  EXPECT_EQ(closer.Push(town.frames[0], Pose()).state, TrackingState::kTracking);
  EXPECT_THROW(closer.Push(town.frames[0], Pose()), InputError);
  EXPECT_EQ(closer.Push(town.frames[1], Pose()).state, TrackingState::kTracking);
  EXPECT_EQ(closer.Keyframes().size(), 1u);  // the odometry says that the camera stands still
}

TEST(TrajectoryCloser, SaysOnceThatNoKeyframeIsRemoved) {
  const testing::RenderedWorld world(testing::SmallStereoTown(320, 160));
  const Recording town = testing::Record(world, 2);
  RunConfig config = Small(1);
  config.run.prune_every = 20;
  TrajectoryCloser closer(config, town.rig);
  for (const InputFrame& frame : town.frames) closer.Push(frame, Pose());
  const std::vector<std::string> warnings = closer.TakeWarnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("run.prune_every"), std::string::npos) << warnings[0];
  config.run.prune_every = 0;
  TrajectoryCloser quiet(config, town.rig);
  quiet.Push(town.frames[0], Pose());
  EXPECT_TRUE(quiet.TakeWarnings().empty());
}

}  // namespace
}  // namespace tutti
