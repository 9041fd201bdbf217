#include "tutti/backend/trajectory_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;

Trajectory ShortCurve() {
  Trajectory out;
  for (int k = 0; k < 20; ++k) {
    const double a = 0.1 * k;
    out.push_back({100.0 + a, Pose(ExpSO3({a, 0.2, -0.5 * a}), {std::sin(a), 10 * a, -a})});
  }
  return out;
}

std::vector<double> Stamps(const Trajectory& trajectory) {
  std::vector<double> out;
  for (const StampedPose& pose : trajectory) out.push_back(pose.stamp_s);
  return out;
}

std::filesystem::path Write(const std::string& text) { return testing::FreshFile("poses.txt", text); }

TEST(TrajectoryFile, EveryFormatIsRecognisedAndReadBack) {
  const Trajectory written = ShortCurve();
  for (const std::string& name : PoseFileFormatNames()) {
    SCOPED_TRACE(name);
    const PoseFileFormat format = ParsePoseFileFormat(name);
    const std::filesystem::path file = testing::FreshFolder() / "poses";
    WritePoseFile(file, written, format);
    const PoseFile read = ReadPoseFile(file, {}, Stamps(written));
    EXPECT_EQ(read.format, format);
    EXPECT_TRUE(read.has_stamps);
    EXPECT_EQ(read.rotations_as_written.size(), format == PoseFileFormat::kKitti ? written.size() : 0u);
    ASSERT_EQ(read.trajectory.size(), written.size());
    for (std::size_t k = 0; k < written.size(); ++k) {
      EXPECT_NEAR(read.trajectory[k].stamp_s, written[k].stamp_s, 1e-6);
      const Pose off = written[k].pose.Inverse() * read.trajectory[k].pose;
      EXPECT_LT(off.translation.norm(), 1e-8);
      EXPECT_LT(off.Angle(), 1e-8);
    }
  }
}

TEST(TrajectoryFile, WithoutTimesKittiAndG2oHaveNoStamps) {
  const std::filesystem::path folder = testing::FreshFolder();
  WritePoseFile(folder / "a.txt", ShortCurve(), PoseFileFormat::kKitti);
  WritePoseFile(folder / "a.g2o", ShortCurve(), PoseFileFormat::kG2o);
  EXPECT_FALSE(ReadPoseFile(folder / "a.txt").has_stamps);
  EXPECT_FALSE(ReadPoseFile(folder / "a.g2o").has_stamps);
  WriteTimes(folder / "times.txt", ShortCurve());
  EXPECT_TRUE(ReadPoseFile(folder / "a.txt", {}, ReadTimes(folder / "times.txt")).has_stamps);
}

TEST(TrajectoryFile, NumbersOfFramesAreTheLinesOfTheTimes) {
  const std::string pose = " 1 0 0 5 0 1 0 6 0 0 1 7\n";
  const std::filesystem::path file = Write("1" + pose + "3" + pose);  // KITTI-360
  EXPECT_TRUE(ReadPoseFile(file).has_numbers);
  EXPECT_FALSE(ReadPoseFile(file).has_stamps);
  EXPECT_EQ(Stamps(ReadPoseFile(file, {}, {10, 11, 12, 13}).trajectory), (std::vector<double>{11, 13}));
  EXPECT_THAT(ErrorOf([&] { ReadPoseFile(file, {}, {10, 11}); }), HasSubstr("frame 3 has no time stamp"));
}

TEST(TrajectoryFile, KeyframesNumberedLikeMillisecondsFollowTheOtherFile) {
  std::string sparse;
  for (int k = 0; k < 20; ++k) sparse += std::to_string(15 * k) + " 0 0 0 0 0 0 1\n";
  PoseFile keyframes = ReadPoseFile(Write(sparse));
  ASSERT_EQ(keyframes.warnings.size(), 1u);
  EXPECT_NEAR(keyframes.trajectory.back().stamp_s, 0.285, 1e-9);
  PoseFile beside_milliseconds = keyframes;
  AgreeOnUnit(0, 0.3, beside_milliseconds);
  EXPECT_NEAR(beside_milliseconds.trajectory.back().stamp_s, 0.285, 1e-9);
  AgreeOnUnit(0, 299, keyframes);
  EXPECT_NEAR(keyframes.trajectory.back().stamp_s, 285, 1e-9);
  EXPECT_TRUE(keyframes.warnings.empty());
}

TEST(TrajectoryFile, TimesThatDoNotFitAreRefused) {
  const std::filesystem::path folder = testing::FreshFolder();
  WritePoseFile(folder / "a.txt", ShortCurve(), PoseFileFormat::kKitti);
  WritePoseFile(folder / "a.g2o", ShortCurve(), PoseFileFormat::kG2o);
  EXPECT_THAT(ErrorOf([&] {
                ReadPoseFile(folder / "a.txt", {}, {1, 2, 3});
              }),
              AllOf(HasSubstr("a.txt: has 20 poses"), HasSubstr("3 time stamps")));
  EXPECT_THAT(ErrorOf([&] { ReadPoseFile(folder / "a.g2o", {}, {1, 2, 3}); }), HasSubstr("vertex 3"));
  EXPECT_THAT(ErrorOf([&] { ReadPoseFile(folder / "a.txt", {}, std::vector<double>(20, 1.0)); }),
              HasSubstr("do not grow at pose 1"));
}

TEST(TrajectoryFile, VerticesWhoseIdsAreTooLargeForStampsCountInTheirOrder) {
  const std::filesystem::path file = testing::FreshFile(
      "a.g2o",
      "PARAMS_SE2OFFSET 0 0 0 0\nVERTEX_SE2 6989586621679009793 2 0 0\nVERTEX_SE2 6989586621679009792 1 0 0\n"
      "EDGE_SE2 6989586621679009792 6989586621679009793 1 0 0 1 0 0 1 0 1\nEDGE_RANGE 1 2\n");
  const PoseFile read = ReadPoseFile(file);
  ASSERT_EQ(read.trajectory.size(), 2u);
  EXPECT_EQ(read.trajectory[1].stamp_s, 1);
  EXPECT_EQ(read.trajectory[1].pose.translation.x(), 2);
  ASSERT_EQ(read.warnings.size(), 2u);  // the poses alone count, so an unknown tag is no error
  EXPECT_THAT(read.warnings[1], HasSubstr("too large for time stamps"));
}

TEST(TrajectoryFile, AnotherFormatThanAskedForIsNamed) {
  const std::filesystem::path file = testing::FreshFolder() / "a.txt";
  WritePoseFile(file, ShortCurve(), PoseFileFormat::kKitti);
  EXPECT_THAT(ErrorOf([&] { ReadPoseFile(file, PoseFileFormat::kTum); }),
              AllOf(HasSubstr("a.txt:1:"), HasSubstr("looks like the format kitti")));
}

TEST(TrajectoryFile, QuaternionsOfAnotherLengthAreNormalisedAndNamed) {
  const PoseFile read = ReadPoseFile(Write("# c\n1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 2\n3 2 0 0 0 0.5 0 0\n"));
  ASSERT_EQ(read.warnings.size(), 1u);
  EXPECT_THAT(read.warnings[0], AllOf(HasSubstr("poses.txt:3:"), HasSubstr("length 1"), HasSubstr(": 2")));
  EXPECT_NEAR(read.trajectory[1].pose.rotation.norm(), 1, 1e-15);
}

TEST(TrajectoryFile, HostileFilesAreRefusedWithTheirLine) {
  EXPECT_THAT(ErrorOf([] { ReadPoseFile(Write("1 0 0 0 0 0 0 1\n2 nan 0 0 0 0 0 1\n")); }),
              HasSubstr("poses.txt:2:"));
  EXPECT_THAT(ErrorOf([] { ReadPoseFile(Write("")); }), HasSubstr("holds no pose"));
  EXPECT_THAT(ErrorOf([] { ReadPoseFile(Write("VERTEX_SE3:QUAT 0 0 0 0 0 0 0\n")); }),
              HasSubstr("poses.txt:1:"));
  EXPECT_THAT(ErrorOf([] { ReadPoseFile("/nowhere/x"); }), HasSubstr("/nowhere/x"));
  EXPECT_THAT(ErrorOf([] { ReadPoseFile(testing::FreshFolder()); }), HasSubstr("is a folder"));
  EXPECT_THAT(ErrorOf([] { ReadPoseFile(Write("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n")); }),
              HasSubstr("tutti optimize"));
}

}  // namespace
}  // namespace tutti
