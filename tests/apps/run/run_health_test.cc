// The word of a run, and its reasons.
#include "apps/run/run_signs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tutti {
namespace {

using ::testing::HasSubstr;

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

TEST(RunHealth, OfARunThatLostMostFramesIsFailed) {
  EXPECT_EQ(HealthOf(WithPoses(20))->word, HealthWord::kFailed);
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
  EXPECT_FALSE(HealthOf(result));
  EXPECT_EQ(HealthText(result), "");
}

}  // namespace
}  // namespace tutti
