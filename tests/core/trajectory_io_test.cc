#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

std::filesystem::path Write(const std::string& text) { return testing::FreshFile("poses.txt", text); }

std::string ErrorOf(const std::string& text, TrajectoryFormat format) {
  return testing::ErrorOf([&] { ReadTrajectory(Write(text), format); });
}

Trajectory CurvedWay() {
  Trajectory out;
  for (int k = 0; k < 50; ++k) {
    const double a = 0.1 * k;
    out.push_back({1311868164.25 + a, Pose(ExpSO3({a, 0.2, -0.5 * a}), {std::sin(a), 10 * a, -a})});
  }
  return out;
}

TEST(TrajectoryIo, EveryFormatReadsBackWhatWasWritten) {
  for (TrajectoryFormat format :
       {TrajectoryFormat::kTum, TrajectoryFormat::kKitti, TrajectoryFormat::kEuroc}) {
    const std::filesystem::path file = testing::FreshFolder() / "poses.txt";
    const Trajectory written = CurvedWay();
    WriteTrajectory(file, written, format);
    EXPECT_EQ(GuessTrajectoryFormat(file), format);
    const Trajectory read = ReadTrajectory(file, format);
    ASSERT_EQ(read.size(), written.size());
    for (std::size_t k = 0; k < read.size(); ++k) {
      EXPECT_LT((read[k].pose.translation - written[k].pose.translation).norm(), 2e-9);
      EXPECT_LT(LogSO3(read[k].pose.rotation.conjugate() * written[k].pose.rotation).norm(), 4e-9);
      const double stamp = format == TrajectoryFormat::kKitti ? static_cast<double>(k) : written[k].stamp_s;
      EXPECT_NEAR(read[k].stamp_s, stamp, 1e-6);
    }
  }
}

TEST(TrajectoryIo, NormalisesQuaternions) {
  const Trajectory read = ReadTrajectory(Write("1 0 0 0 0 0 0 2\n"), TrajectoryFormat::kTum);
  EXPECT_DOUBLE_EQ(read[0].pose.rotation.w(), 1.0);
}

TEST(TrajectoryIo, AcceptsCommentsEmptyLinesAndWindowsLineEnds) {
  const Trajectory read = ReadTrajectory(
      Write("# header\r\n\r\n1 1 2 3 0 0 0 1\r\n  2\t4 5 6 0 0 0 1 # last\r\n"), TrajectoryFormat::kTum);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[1].pose.translation.z(), 6);
}

TEST(TrajectoryIo, DamagedTumFilesNameTheLine) {
  const std::string good = "1 0 0 0 0 0 0 1\n";
  const auto tum = TrajectoryFormat::kTum;
  EXPECT_THAT(ErrorOf(good + "2 0 0 0 0 0 1\n", tum), HasSubstr("poses.txt:2: has 7 columns"));
  EXPECT_THAT(ErrorOf(good + "2 0 nan 0 0 0 0 1\n", tum), HasSubstr("poses.txt:2: 'nan' is not finite"));
  EXPECT_THAT(ErrorOf(good + "2 0 inf 0 0 0 0 1\n", tum), HasSubstr(":2: 'inf' is not finite"));
  EXPECT_THAT(ErrorOf(good + "2 0 x 0 0 0 0 1\n", tum), HasSubstr(":2: 'x' is not a number"));
  EXPECT_THAT(ErrorOf(good + "2 0 0 0 0 0 0 0\n", tum), HasSubstr(":2: the quaternion is zero"));
  EXPECT_THAT(ErrorOf("1e90 0 0 0 0 1e90 0 0 0 0 1e90 0\n", TrajectoryFormat::kKitti),
              HasSubstr("not a rotation matrix"));
  EXPECT_THAT(ErrorOf(good + "2 0 0 0 1e90 0 0 0\n", tum),
              HasSubstr(":2: the quaternion is far from length 1"));
  EXPECT_THAT(ErrorOf(good + good, tum), HasSubstr(":2: repeats the time stamp"));
  EXPECT_THAT(ErrorOf("2 0 0 0 0 0 0 1\n" + good, tum), HasSubstr(":2: goes back in time"));
  EXPECT_THAT(ErrorOf("", tum), HasSubstr("holds no pose"));
  EXPECT_THAT(ErrorOf("# only a comment\n", tum), HasSubstr("holds no pose"));
}

TEST(TrajectoryIo, DamagedKittiAndEurocFilesNameTheLine) {
  EXPECT_THAT(ErrorOf("1 0 0 0 0 1 0 0 0 0 1\n", TrajectoryFormat::kKitti), HasSubstr(":1: has 11 columns"));
  EXPECT_THAT(ErrorOf("9 0 0 0 0 1 0 0 0 0 1 0\n", TrajectoryFormat::kKitti),
              HasSubstr(":1: its 3x3 part is not a rotation"));
  EXPECT_THAT(ErrorOf("1000,0,0,0,1,0,0\n", TrajectoryFormat::kEuroc), HasSubstr(":1: has 7 columns"));
  EXPECT_THAT(ErrorOf("2000,0,0,0,1,0,0,0\n1000,0,0,0,1,0,0,0\n", TrajectoryFormat::kEuroc),
              HasSubstr(":2: goes back in time"));
}

TEST(TrajectoryIo, RepeatedStampsAreLeftOutWithAWarningWhereTheCallerAsks) {
  std::vector<std::string> warnings;
  const Trajectory read = ReadTrajectory(Write("1 7 0 0 0 0 0 1\n1 8 0 0 0 0 0 1\n2 9 0 0 0 0 0 1\n"),
                                         TrajectoryFormat::kTum, &warnings);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].pose.translation.x(), 7);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0], HasSubstr("poses.txt:2: repeats the time stamp"));
}

TEST(TrajectoryIo, TwoMoreColumnsAreStandardDeviations) {
  const std::string two = "0 0 0 0 0 0 0 1 0 0\n1 1 0 0 0 0 0 1 0.5 90\n";
  std::vector<MotionSigma> sigmas;
  EXPECT_EQ(ReadTrajectory(Write(two), TrajectoryFormat::kTum, nullptr, nullptr, &sigmas).size(), 2u);
  ASSERT_EQ(sigmas.size(), 2u);
  EXPECT_DOUBLE_EQ(sigmas[1].translation_m, 0.5);
  EXPECT_NEAR(sigmas[1].rotation_rad, M_PI / 2, 1e-12);
  EXPECT_THAT(ErrorOf(two, TrajectoryFormat::kTum), HasSubstr(":1: has 10 columns; the TUM format has 8"));
  const auto refused = [&](const std::string& text) {
    return testing::ErrorOf(
        [&] { ReadTrajectory(Write(text), TrajectoryFormat::kTum, nullptr, nullptr, &sigmas); });
  };
  EXPECT_THAT(refused(two + "2 1 0 0 0 0 0 1\n"), HasSubstr(":3: has 8 columns; the first line has 10"));
  EXPECT_THAT(refused("0 0 0 0 0 0 0 1 -1 0\n"), HasSubstr(":1: a standard deviation is below 0"));
  EXPECT_THAT(refused("0 0 0 0 0 0 0 1 nan 0\n"), HasSubstr("not finite"));
}

TEST(TrajectoryIo, StandardDeviationsMayBeInAFileOfTheirOwn) {
  const Trajectory poses = {{10, Pose()}, {11, Pose()}};
  const auto read = [&](const std::string& text) {
    return ReadMotionSigmas(testing::FreshFile("sigmas.txt", text), poses);
  };
  EXPECT_DOUBLE_EQ(read("# m deg\n0 0\n0.2 1\n")[1].translation_m, 0.2);
  EXPECT_NEAR(read("10 0 0\n11 0.2 180\n")[1].rotation_rad, M_PI, 1e-12);
  const auto refused = [&](const std::string& text) { return testing::ErrorOf([&] { read(text); }); };
  EXPECT_THAT(refused("10 0 0\n12 0 0\n"), HasSubstr("sigmas.txt:2: is not of the time of its pose"));
  EXPECT_THAT(refused("0 0\n"), HasSubstr("sigmas.txt: has 1 lines for 2 poses"));
  EXPECT_THAT(refused("0 0\n0 0\n0 0\n"), HasSubstr("sigmas.txt:3: there are only 2 poses"));
  EXPECT_THAT(refused("0 0 0 0\n"), HasSubstr("sigmas.txt:1: has 4 columns"));
  EXPECT_THAT(refused("0 -1\n0 0\n"), HasSubstr("below 0"));
}

TEST(TrajectoryIo, FilesThatCanNotBeOpenedAreInputErrors) {
  EXPECT_THROW(ReadTrajectory("/nonexistent/poses.txt", TrajectoryFormat::kTum), InputError);
  EXPECT_THROW(ReadTrajectory(testing::FreshFolder(), TrajectoryFormat::kTum), InputError);
  EXPECT_THROW(WriteTrajectory("/nonexistent/folder/poses.txt", CurvedWay(), TrajectoryFormat::kTum),
               InputError);
  EXPECT_THROW(ReadTimes("/nonexistent/times.txt"), InputError);
  EXPECT_THROW(ParseTrajectoryFormat("tumm"), InputError);
}

}  // namespace
}  // namespace tutti
