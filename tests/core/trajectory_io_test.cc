#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/text_reader.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::filesystem::path Write(const std::string& text) { return testing::FreshFile("poses.txt", text); }

std::string TextOf(const std::filesystem::path& file) { return internal::ReadText(file, "", 1 << 20); }

std::string ReadingError(const std::string& text, TrajectoryFormat format) {
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
  EXPECT_THAT(ReadingError(good + "2 0 0 0 0 0 1\n", tum), HasSubstr("poses.txt:2: has 7 columns"));
  EXPECT_THAT(ReadingError(good + "2 0 nan 0 0 0 0 1\n", tum), HasSubstr("poses.txt:2: 'nan' is not finite"));
  EXPECT_THAT(ReadingError(good + "2 0 inf 0 0 0 0 1\n", tum), HasSubstr(":2: 'inf' is not finite"));
  EXPECT_THAT(ReadingError(good + "2 0 x 0 0 0 0 1\n", tum), HasSubstr(":2: 'x' is not a number"));
  EXPECT_THAT(ReadingError(good + "2 0 0 0 0 0 0 0\n", tum), HasSubstr(":2: the quaternion is zero"));
  EXPECT_THAT(ReadingError("1e90 0 0 0 0 1e90 0 0 0 0 1e90 0\n", TrajectoryFormat::kKitti),
              HasSubstr("not a rotation matrix"));
  EXPECT_THAT(ReadingError(good + "2 0 0 0 1e90 0 0 0\n", tum),
              HasSubstr(":2: the quaternion is far from length 1"));
  EXPECT_THAT(ReadingError(good + good, tum), HasSubstr(":2: repeats the time stamp"));
  EXPECT_THAT(ReadingError("2 0 0 0 0 0 0 1\n" + good, tum), HasSubstr(":2: goes back in time"));
  EXPECT_THAT(ReadingError("", tum), HasSubstr("holds no pose"));
  EXPECT_THAT(ReadingError("# only a comment\n", tum), HasSubstr("holds no pose"));
}

TEST(TrajectoryIo, DamagedKittiAndEurocFilesNameTheLine) {
  EXPECT_THAT(ReadingError("1 0 0 0 0 1 0 0 0 0 1\n", TrajectoryFormat::kKitti),
              HasSubstr(":1: has 11 columns"));
  EXPECT_THAT(ReadingError("9 0 0 0 0 1 0 0 0 0 1 0\n", TrajectoryFormat::kKitti),
              HasSubstr(":1: its 3x3 part is not a rotation"));
  EXPECT_THAT(ReadingError("1000,0,0,0,1,0,0\n", TrajectoryFormat::kEuroc), HasSubstr(":1: has 7 columns"));
  EXPECT_THAT(ReadingError("2000,0,0,0,1,0,0,0\n1000,0,0,0,1,0,0,0\n", TrajectoryFormat::kEuroc),
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
  TrajectoryDetails details;
  EXPECT_EQ(ReadTrajectory(Write(two), TrajectoryFormat::kTum, nullptr, &details).size(), 2u);
  const std::vector<MotionSigma> sigmas = details.sigmas;
  ASSERT_EQ(sigmas.size(), 2u);
  EXPECT_DOUBLE_EQ(sigmas[1].translation_m, 0.5);
  EXPECT_NEAR(sigmas[1].rotation_rad, M_PI / 2, 1e-12);
  EXPECT_THAT(ReadingError(two, TrajectoryFormat::kTum),
              HasSubstr(":1: has 10 columns; the TUM format has 8"));
  const auto refused = [&](const std::string& text) {
    return testing::ErrorOf([&] { ReadTrajectory(Write(text), TrajectoryFormat::kTum, nullptr, &details); });
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

// The same three poses, in any columns.
constexpr double kX[3] = {1, 2, 4};

void ExpectThePoses(const std::string& text, bool rotations = true) {
  SCOPED_TRACE(text);
  const std::filesystem::path file = Write(text);
  std::vector<std::string> warnings;
  TrajectoryDetails details;
  const Trajectory read = ReadTrajectory(file, GuessTrajectoryFormat(file), &warnings, &details);
  ASSERT_EQ(read.size(), 3u);
  EXPECT_TRUE(details.has_stamps);
  EXPECT_EQ(HasRotations(read), rotations);
  for (std::size_t k = 0; k < read.size(); ++k) {
    EXPECT_NEAR(read[k].stamp_s, 1403636579.75 + 0.25 * static_cast<double>(k), 1e-6);
    EXPECT_EQ(read[k].pose.translation, Eigen::Vector3d(kX[k], 0.5, -1));
    if (!rotations) continue;
    EXPECT_NEAR(read[k].pose.rotation.w(), 0.6, 1e-12);
    EXPECT_NEAR(read[k].pose.rotation.x(), 0.8, 1e-12);
  }
}

TEST(TrajectoryIo, ALineThatNamesTheColumnsDecidesWhichIsWhich) {
  const auto table = [](const std::string& names, const std::string& between, auto row) {
    std::string text = names + "\n";
    for (int k = 0; k < 3; ++k) {
      std::string line;
      for (const std::string& word : row(k, std::to_string(1403636579.75 + 0.25 * k), std::to_string(kX[k])))
        line += (line.empty() ? "" : between) + word;
      text += line + "\n";
    }
    return text;
  };
  using Row = std::vector<std::string>;
  const auto tum = [](int, const std::string& t, const std::string& x) {
    return Row{t, x, "0.5", "-1", "0.8", "0", "0", "0.6"};
  };
  ExpectThePoses(table("timestamp tx ty tz qx qy qz qw", " ", tum));
  ExpectThePoses(table("timestamp,tx,ty,tz,qx,qy,qz,qw", ",", tum));
  ExpectThePoses(table("t;x;y;z;q_x;q_y;q_z;q_w", ";", tum));
  ExpectThePoses(table("# time [s]\tpos_x\tpos_y\tpos_z\tqx\tqy\tqz\tqw", "\t", tum));
  ExpectThePoses(table("t,x,y,z,qw,qx,qy,qz", ",", [](int, const std::string& t, const std::string& x) {
    return Row{t, x, "0.5", "-1", "0.6", "0.8", "0", "0"};
  }));
  ExpectThePoses(
      table("# stamp qw qx qy qz tx ty tz", " ", [](int, const std::string& t, const std::string& x) {
        return Row{t, "0.6", "0.8", "0", "0", x, "0.5", "-1"};
      }));
  const auto counted = [](int k, const std::string& t, const std::string& x) {
    return Row{std::to_string(7 + k), t, x, "0.5", "-1", "0.8", "0", "0", "0.6"};
  };
  ExpectThePoses(table("num, t, x, y, z, qx, qy, qz, qw", ", ", counted));
  ExpectThePoses(table("", " ", counted));
  ExpectThePoses(table("", ",", counted));
  ExpectThePoses(
      table("%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.position.x,"
            "field.pose.position.y,field.pose.position.z,field.pose.orientation.x,"
            "field.pose.orientation.y,field.pose.orientation.z,field.pose.orientation.w",
            ",", [](int k, const std::string&, const std::string& x) {
              const std::string ns = std::to_string(1403636579750000000 + 250000000LL * k);
              return Row{ns, "1", ns, "map", x, "0.5", "-1", "0.8", "0", "0", "0.6"};
            }));
  ExpectThePoses(table("timestamp_ms,v_x,v_y,v_z,p_x,p_y,p_z,yaw", ",",
                       [](int k, const std::string&, const std::string& x) {
                         return Row{
                             std::to_string(1403636579750 + 250LL * k), "9", "9", "9", x, "0.5", "-1", "3"};
                       }),
                 false);
  EXPECT_THAT(ReadingError("foo bar\n1 2\n", TrajectoryFormat::kTum),
              HasSubstr(":1: 'foo' is not a number; a first line that names columns"));
  EXPECT_THAT(ReadingError("t x y z qx qy qz qw\n1 0 0 0 1\n", TrajectoryFormat::kTum),
              HasSubstr(":2: has 5 columns, but the line above names 8"));
}

TEST(TrajectoryIo, StampsInAnyUnitBecomeSecondsAndAreSaid) {
  const std::pair<const char*, double> units[] = {
      {"milliseconds", 1e3}, {"microseconds", 1e6}, {"nanoseconds", 1e9}};
  for (const auto& [name, per_second] : units) {
    for (const double start_s : {0.0, 1403636579.0}) {
      std::string text;
      for (int k = 0; k < 10; ++k)
        text += std::to_string((start_s + 0.05 * k) * per_second) + " 0 0 0 0 0 0 1\n";
      std::vector<std::string> warnings;
      const Trajectory read = ReadTrajectory(Write(text), TrajectoryFormat::kTum, &warnings);
      EXPECT_NEAR(read.back().stamp_s, start_s + 0.45, 1e-6) << name << start_s;
      ASSERT_EQ(warnings.size(), 1u);
      EXPECT_THAT(warnings[0], HasSubstr(std::string("its time stamps are in ") + name));
    }
  }
  std::vector<std::string> warnings;
  ReadTrajectory(Write("1.4e18 0 0 0 0 0 0 1\n"), TrajectoryFormat::kTum, &warnings, nullptr,
                 StampUnit::kNanoseconds);
  EXPECT_TRUE(warnings.empty()) << "that of the images was said";
  EXPECT_NEAR(ReadTimes(Write("1403636579763555584 a.png\n1403636579813555456 b.png\n"), &warnings)[1],
              1403636579.813555456, 1e-6);
  EXPECT_EQ(warnings.size(), 1u);
}

TEST(TrajectoryIo, StampsInNanosecondsAreWrittenAsTheyWereRead) {
  const std::string stamps[] = {"1403636579763555584", "1403636579813555457"};
  const std::filesystem::path file =
      Write(stamps[0] + ".000000 0 0 0 0 0 0 1\n" + stamps[1] + " 0 0 0 0 0 0 1\n");
  TrajectoryDetails details;
  const Trajectory read = ReadTrajectory(file, TrajectoryFormat::kTum, nullptr, &details);
  WriteTrajectory(file, read, TrajectoryFormat::kEuroc, details.stamps_ns);
  EXPECT_THAT(TextOf(file), AllOf(HasSubstr("\n" + stamps[0] + ","), HasSubstr("\n" + stamps[1] + ",")));
  WriteTrajectory(file, read, TrajectoryFormat::kTum, details.stamps_ns);
  EXPECT_THAT(TextOf(file), HasSubstr("\n1403636579.813555457 "));
  const Trajectory late = {{1e10, Pose()}};
  EXPECT_THAT(testing::ErrorOf([&] { WriteTrajectory(file, late, TrajectoryFormat::kEuroc); }),
              HasSubstr("1e+10 s does not fit into EuRoC's nanoseconds"));
}

TEST(TrajectoryIo, PositionsAloneHaveNoRotation) {
  for (const char* text : {"1 2 3 4\n2 3 4 5\n", "1,2,3,4\n2,3,4,5\n", "1 2 3 4 0 0 0 0\n2 3 4 5 0 0 0 0\n",
                           "0 1 2 3 4\n1 2 3 4 5\n"}) {
    const std::filesystem::path file = Write(text);
    const Trajectory read = ReadTrajectory(file, GuessTrajectoryFormat(file));
    ASSERT_EQ(read.size(), 2u);
    EXPECT_FALSE(HasRotations(read)) << text;
    EXPECT_EQ(read[1].pose.translation, Eigen::Vector3d(3, 4, 5));
    WriteTrajectory(file, read, TrajectoryFormat::kTum);
    EXPECT_FALSE(HasRotations(ReadTrajectory(file, TrajectoryFormat::kTum)));
    EXPECT_THAT(testing::ErrorOf([&] { WriteTrajectory(file, read, TrajectoryFormat::kKitti); }),
                HasSubstr("needs rotations"));
  }
  EXPECT_THAT(ReadingError("1 2 3 4 0 0 0 0\n2 3 4 5 0 0 0 1\n", TrajectoryFormat::kTum),
              HasSubstr(":1: the quaternion is zero"));
}

TEST(TrajectoryIo, KittiLinesMayHaveANumberAndAFourthRow) {
  const std::string row = "1 0 0 5 0 1 0 6 0 0 1 7", last = " 0 0 0 1";
  for (const auto& [begin, end] : {std::pair<std::string, std::string>("4 ", ""), {"4 ", last}, {"", last}}) {
    const std::filesystem::path file =
        Write(begin + row + end + "\n" + (begin.empty() ? "" : "7 ") + row + end + "\n");
    EXPECT_EQ(GuessTrajectoryFormat(file), TrajectoryFormat::kKitti);
    TrajectoryDetails details;
    const Trajectory read = ReadTrajectory(file, TrajectoryFormat::kKitti, nullptr, &details);
    EXPECT_EQ(read[1].pose.translation, Eigen::Vector3d(5, 6, 7));
    EXPECT_FALSE(details.has_stamps);
    EXPECT_EQ(details.has_numbers, !begin.empty());
    EXPECT_EQ(read[1].stamp_s, begin.empty() ? 1 : 7);
  }
  TrajectoryDetails details;
  const Trajectory timed =
      ReadTrajectory(Write("1403636579.5 " + row + "\n"), TrajectoryFormat::kKitti, nullptr, &details);
  EXPECT_TRUE(details.has_stamps);
  EXPECT_EQ(timed[0].stamp_s, 1403636579.5);
  EXPECT_THAT(ReadingError(row + " 0 0 1 1\n", TrajectoryFormat::kKitti), HasSubstr("is not 0 0 0 1"));
}

TEST(TrajectoryIo, StampsThatLostTheirDigitsAreSaid) {
  std::vector<std::string> warnings;
  std::string text;
  for (int k = 0; k < 20; ++k) text += std::to_string(1403636579 + k / 10) + " 0 0 0 0 0 0 1\n";
  EXPECT_EQ(ReadTrajectory(Write(text), TrajectoryFormat::kTum, &warnings).size(), 2u);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0], HasSubstr("18 of 20; were the stamps written with too few digits?"));
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
