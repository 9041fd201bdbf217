// The word of a run, and its reasons.
#include "apps/run/run_health.h"

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
  EXPECT_THAT(HealthOf(unread)->reasons[0], HasSubstr("no frame could be read"));
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

TEST(RunHealth, ImagesWithoutPosesHaveNone) {
  RunResult result = WithPoses(0);
  result.appearance_only = true;
  EXPECT_FALSE(HealthOf(result));
  EXPECT_EQ(HealthText(result), "");
}

}  // namespace
}  // namespace tutti
