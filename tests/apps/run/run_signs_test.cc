// Each sign measures what its name says, from a result alone.
#include "apps/run/run_signs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>
#include <string_view>

namespace tutti {
namespace {

// 100 frames, 1 m each 0.1 s, with a map of one camera.
RunResult StraightAhead() {
  RunResult result;
  result.rig.sensor = Sensor::kMono;
  result.rig.camera.width = 200;
  result.rig.camera.fx = result.rig.camera.fy = 100;
  result.frames_total = result.frames_tracked = 100;
  for (int i = 0; i < 100; ++i) {
    result.trajectory.push_back({0.1 * i, Pose(Eigen::Quaterniond::Identity(), {0, 0, double(i)})});
    result.frame_inliers.push_back(100);
  }
  result.map_figures.keyframes = 20;
  result.map_figures.landmarks = 150;
  result.map_figures.misfit_px = 0.5;
  return result;
}

std::optional<double> Sign(const RunResult& result, const std::string& name) {
  for (const RunSign& sign : SignsOf(result)) {
    if (sign.kind->name == name) return sign.value;
  }
  return std::nullopt;
}

TEST(RunSigns, EachHasItsOwnNameAUnitAndASentenceWithOneValueAtMost) {
  std::set<std::string> names;
  for (const SignKind& kind : SignKinds()) {
    EXPECT_TRUE(names.insert(kind.name).second) << kind.name;
    EXPECT_TRUE(std::set<std::string>({"share", "1", "px", "factor"}).count(kind.unit)) << kind.name;
    const std::string_view says = kind.says;
    EXPECT_EQ(says.find("%s"), says.rfind("%s")) << kind.name;
    EXPECT_FALSE(std::string_view(kind.meaning).empty()) << kind.name;
    EXPECT_FALSE(std::string_view(kind.advice).empty()) << kind.name;
  }
}

TEST(RunSigns, NoneOfASmoothRunIsBeyondItsLimit) {
  const std::vector<RunSign> signs = SignsOf(StraightAhead());
  EXPECT_GT(signs.size(), 8u);
  for (const RunSign& sign : signs) {
    EXPECT_FALSE(sign.kind->IsDoubtful(sign.value)) << sign.kind->name << " " << sign.value;
    EXPECT_FALSE(sign.kind->IsFailed(sign.value)) << sign.kind->name;
  }
}

TEST(RunSigns, FramesThatCouldNotBeReadAreNotLost) {
  RunResult result = StraightAhead();
  result.frames_tracked = 90;
  EXPECT_DOUBLE_EQ(*Sign(result, "frames_posed"), 0.9);
  result.bad.resize(10);
  EXPECT_DOUBLE_EQ(*Sign(result, "frames_posed"), 1);
}

TEST(RunSigns, OtherPiecesCountAgainstTheLargest) {
  RunResult result = StraightAhead();
  result.other_pieces = {Trajectory(100)};
  EXPECT_DOUBLE_EQ(*Sign(result, "largest_piece"), 0.5);
}

TEST(RunSigns, FramesWithFewInliersAreCounted) {
  RunResult result = StraightAhead();
  for (int i = 0; i < 25; ++i) result.frame_inliers[static_cast<std::size_t>(i)] = 12;
  EXPECT_DOUBLE_EQ(*Sign(result, "few_inliers"), 0.25);
}

TEST(RunSigns, AStepThatIsLongerThanThoseAroundItIsAJump) {
  EXPECT_NEAR(*Sign(StraightAhead(), "speed_jump"), 1, 1e-6);
  RunResult result = StraightAhead();
  for (std::size_t i = 50; i < 100; ++i) result.trajectory[i].pose.translation.z() += 6;
  EXPECT_NEAR(*Sign(result, "speed_jump"), 7, 1e-6);
}

TEST(RunSigns, ACameraThatStandsStillDoesNotJump) {
  RunResult result = StraightAhead();
  for (std::size_t i = 0; i < 100; ++i)
    result.trajectory[i].pose.translation = {0, i % 2 == 0 ? 0 : 1e-4, i % 9 == 0 ? 3e-4 : 0};
  EXPECT_GT(*Sign(result, "speed_jump"), 2.5);  // nobody knows how far away what it sees is
  result.map_figures.depth = {{0, 2.0}, {50, 3.0}, {99, 3.0}};
  EXPECT_EQ(*Sign(result, "speed_jump"), 1);
  result.trajectory[60].pose.translation.x() = 0.1;
  EXPECT_GT(*Sign(result, "speed_jump"), 10);
}

TEST(RunSigns, FramesThatAreMissingAreNoJump) {
  RunResult result = StraightAhead();
  result.trajectory.erase(result.trajectory.begin() + 40, result.trajectory.begin() + 50);
  EXPECT_NEAR(*Sign(result, "speed_jump"), 1, 1e-6);
}

TEST(RunSigns, AFocalLengthIsOffOnlyBeyondItsUncertainty) {
  RunResult result = StraightAhead();
  EXPECT_FALSE(Sign(result, "focal_length_off"));
  result.lens_check = {true, 1.2, 0.01, 0, false};
  EXPECT_NEAR(*Sign(result, "focal_length_off"), std::log(1.2) - 0.0125, 1e-12);
  result.lens_check.sigma = 0.15;
  EXPECT_EQ(*Sign(result, "focal_length_off"), 0);
}

TEST(RunSigns, TheLensIsJudgedAtTheEdgeOfTheImage) {
  RunResult result = StraightAhead();
  result.lens = LensFound();
  result.lens->k1 = -0.05;
  EXPECT_NEAR(*Sign(result, "lens_off"), 0.05, 1e-12);  // the edge is at 45 degrees
  result.rig.camera.fx = 200;
  EXPECT_NEAR(*Sign(result, "lens_off"), 0.05 / 4, 1e-12);
  result.lens_check = {false, 1, 1, 0.1, false};
  EXPECT_NEAR(*Sign(result, "lens_off"), 0.05 / 4, 1e-12) << "nothing speaks for it";
  result.lens_check.other_lens = true;
  EXPECT_NEAR(*Sign(result, "lens_off"), 0.1 / 4, 1e-12) << "whatever the focal length is";
}

Loop Recognised(double candidate_s, double query_s, bool accepted) {
  Loop loop;
  loop.candidate_stamp_s = candidate_s;
  loop.query_stamp_s = query_s;
  loop.verified = true;
  loop.state = accepted ? LoopState::kInMap : LoopState::kRejected;
  return loop;
}

TEST(RunSigns, LoopsThatTheMapRefusesCountFromThreeOnAndNeighboursDoNot) {
  RunResult result = StraightAhead();
  for (int i = 0; i < 3; ++i) result.loops.push_back(Recognised(i, 60 + i, true));
  for (int i = 0; i < 9; ++i) result.loops.push_back(Recognised(i, i + 1, false));
  EXPECT_EQ(*Sign(result, "loops_refused"), 0);
  for (int i = 0; i < 2; ++i) result.loops.push_back(Recognised(i, 70 + i, false));
  EXPECT_EQ(*Sign(result, "loops_refused"), 0);
  for (int i = 2; i < 6; ++i) result.loops.push_back(Recognised(i, 70 + i, false));
  EXPECT_NEAR(*Sign(result, "loops_refused"), 6.0 / 9, 1e-12);
}

TEST(RunSigns, OneCamerasSignsAreNotThoseOfDepth) {
  RunResult result = StraightAhead();
  EXPECT_TRUE(Sign(result, "scale_jump"));
  EXPECT_TRUE(Sign(result, "without_parallax"));
  result.rig.sensor = Sensor::kRgbd;
  EXPECT_FALSE(Sign(result, "scale_jump"));
  EXPECT_FALSE(Sign(result, "without_parallax"));
}

TEST(RunSigns, AnOdometryThatIsFollowedIsNotJudgedByTheMap) {
  RunResult result = StraightAhead();
  result.given_odometry = true;
  EXPECT_FALSE(Sign(result, "landmarks"));
  EXPECT_FALSE(Sign(result, "speed_jump"));
  EXPECT_TRUE(Sign(result, "loops_refused"));
}

TEST(RunSigns, ImagesWithoutPosesHaveNone) {
  RunResult result = StraightAhead();
  result.appearance_only = true;
  EXPECT_TRUE(SignsOf(result).empty());
}

}  // namespace
}  // namespace tutti
