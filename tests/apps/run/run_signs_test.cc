// Each sign measures what its name says, from a result alone; the word of a run, and its reasons.
#include "apps/run/run_signs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "frontend/features/features.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

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
    EXPECT_TRUE(std::set<std::string>({"share", "1", "px", "ms", "factor"}).count(kind.unit)) << kind.name;
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

TEST(RunSigns, ACorrectionThatMovesHalfOfTheMapIsNoJump) {
  RunResult result = StraightAhead();
  Map map({1.0F});
  for (int id = 0; id < 20; ++id) {
    Keyframe keyframe;
    keyframe.frame_index = 5 * id;
    keyframe.T_world_camera.translation.z() = 5 * id;
    keyframe.features = std::make_shared<const FrameFeatures>();
    map.AddKeyframe(keyframe);
  }
  for (int i = 0; i < 100; ++i)
    map.AddFrame(i, 0.1 * i, i / 5, result.trajectory[static_cast<std::size_t>(i)].pose.Inverse());
  for (int id = 10; id < 20; ++id) map.keyframe(id).T_world_camera.translation.z() += 6;
  result.trajectory = FrameTrajectory(map);
  EXPECT_NEAR(*Sign(result, "speed_jump"), 1 + 6.0 / 5, 1e-6);
}

TEST(RunSigns, AFocalLengthIsOffOnlyBeyondItsUncertainty) {
  RunResult result = StraightAhead();
  EXPECT_FALSE(Sign(result, "focal_length_off"));
  result.lens_check = {true, 1.2, 0.01, 0, false};
  EXPECT_NEAR(*Sign(result, "focal_length_off"), std::log(1.2) - 0.02, 1e-12);
  result.lens_check.sigma = 0.15;
  EXPECT_EQ(*Sign(result, "focal_length_off"), 0);
}

TEST(RunSigns, ClocksAreOffOnlyBeyondTheirUncertainty) {
  RunResult result = StraightAhead();
  EXPECT_FALSE(Sign(result, "clocks_off")) << "the rig tells them, or there is no depth camera";
  result.clocks = {0.02, INFINITY, -0.015, 0.002};
  EXPECT_NEAR(Sign(result, "clocks_off").value(), 9, 1e-9);
  result.clocks->depth_delay_sigma_s = 0.006;
  EXPECT_EQ(Sign(result, "clocks_off"), 0.0);
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
  loop.edge.candidate = 3;
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
  result.loops.push_back(Recognised(7, 80, false));
  result.loops.back().edge.candidate = -1;  // no constraint came of it
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

RunResult WithPoses(std::size_t tracked) {
  RunResult result;
  result.frames_total = 100;
  result.frames_tracked = tracked;
  return result;
}

TEST(RunHealth, OfARunWithoutASignIsGood) {
  const auto health = HealthOf(WithPoses(100));
  ASSERT_TRUE(health);
  EXPECT_EQ(health->word, HealthWord::kGood);
  EXPECT_TRUE(health->reasons.empty());
  EXPECT_FALSE(health->signs.empty());
  EXPECT_THAT(HealthText(WithPoses(100)), HasSubstr("good: nothing"));
}

TEST(RunHealth, OfARunThatLostFramesIsDoubtfulAndSaysWhatToDo) {
  const auto health = HealthOf(WithPoses(90));
  EXPECT_EQ(health->word, HealthWord::kDoubtful);
  ASSERT_EQ(health->reasons.size(), 1u);
  EXPECT_THAT(health->reasons[0], HasSubstr("only 90.0 % of the frames have a pose in trajectory.txt; "));
  EXPECT_THAT(HealthText(WithPoses(90)), HasSubstr("doubtful:\n    * only 90.0 %"));
}

TEST(RunHealth, OfARunWithoutAPoseIsFailed) {
  const auto health = HealthOf(WithPoses(0));
  EXPECT_EQ(health->word, HealthWord::kFailed);
  ASSERT_EQ(health->reasons.size(), 1u);
  EXPECT_THAT(health->reasons[0], HasSubstr("only 0.0 % of the frames have a pose"));
  RunResult unread = WithPoses(0);
  unread.bad.resize(100);
  EXPECT_EQ(HealthOf(unread)->word, HealthWord::kFailed);
  EXPECT_THAT(HealthOf(unread)->reasons, ::testing::Contains(HasSubstr("100.0 % of the images are damaged")));
}

TEST(RunHealth, OneDoubtDoesNotHideAFailure) {
  RunResult result = WithPoses(20);
  result.camera_guessed = true;
  EXPECT_EQ(HealthOf(result)->word, HealthWord::kFailed);
  EXPECT_EQ(HealthOf(result)->reasons.size(), 2u);
  result.frames_tracked = 100;
  EXPECT_EQ(HealthOf(result)->word, HealthWord::kDoubtful);
}

TEST(RunHealth, FindingsOfTheCalibrationAreADoubt) {
  RunResult result = WithPoses(100);
  result.calibration_findings.push_back({"the field of view is 4 deg", "check fx"});
  EXPECT_EQ(HealthOf(result)->word, HealthWord::kDoubtful);
}

// Ground truth on a circle of 1 m around twice; ATE and scale as they are given.
RunResult WithGroundTruth(double ate_m, double scale) {
  RunResult result = WithPoses(100);
  result.rig.sensor = Sensor::kRgbd;
  RunEvaluation evaluation;
  evaluation.path_m = 12.6;
  evaluation.extent_m = 1;
  evaluation.slam.valid = evaluation.scaled.valid = true;
  evaluation.slam.ate.rmse = ate_m;
  evaluation.scaled.scale = scale;
  evaluation.scaled.ate.rmse = 0.01;
  result.evaluation = evaluation;
  return result;
}

TEST(RunHealth, OfARunThatItsGroundTruthContradictsIsNotGood) {
  EXPECT_EQ(HealthOf(WithGroundTruth(0.03, 1.01))->word, HealthWord::kGood);
  const auto scaled = HealthOf(WithGroundTruth(0.8, 5));
  EXPECT_EQ(scaled->word, HealthWord::kFailed);
  EXPECT_THAT(scaled->reasons, ::testing::Contains(HasSubstr("the scale is off by a factor of 4.90")));
  EXPECT_EQ(HealthOf(WithGroundTruth(0.03, 1 / 1.2))->word, HealthWord::kDoubtful);
  EXPECT_EQ(HealthOf(WithGroundTruth(0.22 * 12.6, 1))->word, HealthWord::kFailed) << "22 % of the path";
  EXPECT_EQ(HealthOf(WithGroundTruth(0.4, 1))->word, HealthWord::kDoubtful) << "40 % of its extent";
}

TEST(RunHealth, AGroundTruthThatHardlyMovesSaysLittle) {
  RunResult still = WithGroundTruth(0.01, 3);
  still.evaluation->path_m = 0.03;
  still.evaluation->extent_m = 0.004;
  EXPECT_EQ(HealthOf(still)->word, HealthWord::kGood) << "references are not better than 2 cm";
}

TEST(RunHealth, DamagedSkippedAndDroppedImagesCount) {
  RunResult result = WithPoses(1);
  result.frames_total = 1;
  result.skipped_share = 59.0 / 60;
  EXPECT_EQ(HealthOf(result)->word, HealthWord::kFailed);
  EXPECT_THAT(HealthOf(result)->reasons[0], HasSubstr("98.3 % of the images are damaged or repeat a time"));
  result = WithPoses(90);
  result.bad.resize(10);
  EXPECT_EQ(HealthOf(result)->word, HealthWord::kDoubtful);
  result = WithPoses(60);
  result.frames_dropped = 40;
  result.realtime = true;
  EXPECT_THAT(HealthOf(result)->reasons,
              ::testing::ElementsAre(HasSubstr("40.0 % of the frames were dropped")));
  result = WithPoses(100);
  result.rig.sensor = Sensor::kRgbd;
  result.frames_without_depth = 50;
  EXPECT_THAT(HealthOf(result)->reasons,
              ::testing::ElementsAre(HasSubstr("50.0 % of the frames came without")));
}

TEST(RunHealth, OfPhotosThatAreNoFilmNamesTheCommandForThem) {
  RunResult photos = WithPoses(10);
  EXPECT_THAT(HealthText(photos), ::testing::Not(HasSubstr("tutti loops")));
  photos.dataset = "corridor";
  EXPECT_THAT(HealthText(photos), HasSubstr("`tutti loops corridor` finds those that show the same place"));
  for (const char* film : {"camera:0", "/proc/self/exe"}) {  // the latter: any file
    photos.dataset = film;
    EXPECT_THAT(HealthText(photos), ::testing::Not(HasSubstr("tutti loops"))) << film;
  }
}

TEST(RunHealth, ImagesWithoutPosesHaveNone) {
  RunResult result = WithPoses(0);
  result.appearance_only = true;
  EXPECT_TRUE(SignsOf(result).empty());
  EXPECT_FALSE(HealthOf(result));
  EXPECT_EQ(HealthText(result), "");
}

}  // namespace
}  // namespace tutti
