#include "tutti/loopclosure/ground_truth.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

using testing::FreshFile;

std::string Problem(const fs::path& file) {
  try {
    ReadLoopMatrix(file, 10);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(LoopMatrix, TextOfZerosAndOnes) {
  const LoopGroundTruth truth = ReadLoopMatrix(FreshFile("t.txt", "# comment\n0 0 0\n0 0 0\n1,0.5,0\n"), 3);
  EXPECT_EQ(truth.size(), 3);
  EXPECT_EQ(truth.At(2, 0), LoopLabel::kLoop);
  EXPECT_EQ(truth.At(2, 1), LoopLabel::kIgnore);
  EXPECT_EQ(truth.RowsWithLoop(), 1);
}

TEST(LoopMatrix, UpperTriangleIsTransposed) {
  const LoopGroundTruth truth = ReadLoopMatrix(FreshFile("t.txt", "0 0 255\n0 0 0\n0 0 0\n"), 3);
  EXPECT_EQ(truth.At(2, 0), LoopLabel::kLoop);
}

// What compression may have made of black and white, and images of zeros and ones.
TEST(LoopMatrix, NearlyBlackIsBlackAndNearlyWhiteIsWhite) {
  cv::Mat image = cv::Mat::zeros(9, 9, CV_8U);
  const std::vector<std::uint8_t> greys = {0, 1, 5, 6, 128, 249, 250, 255};
  for (std::size_t c = 0; c < greys.size(); ++c) image.at<std::uint8_t>(8, static_cast<int>(c)) = greys[c];
  const fs::path file = testing::FreshFolder() / "t.png";
  cv::imwrite(file.string(), image);
  const LoopGroundTruth truth = ReadLoopMatrix(file, 9);
  std::vector<LoopLabel> labels;
  labels.reserve(greys.size());
  for (int c = 0; c < 8; ++c) labels.push_back(truth.At(8, c));
  constexpr LoopLabel kNone = LoopLabel::kNone, kIgnore = LoopLabel::kIgnore, kLoop = LoopLabel::kLoop;
  EXPECT_EQ(labels, (std::vector<LoopLabel>{kNone, kLoop, kNone, kIgnore, kIgnore, kIgnore, kLoop, kLoop}));
}

// Two lines of two numbers are a matrix, other numbers of lines are pairs, whichever comes first.
TEST(LoopMatrix, TwoColumnsArePairsUnlessTheyAreSquare) {
  EXPECT_EQ(ReadLoopMatrix(FreshFile("t.txt", "0 0\n1 0\n"), 9).size(), 2);
  const LoopGroundTruth pairs = ReadLoopMatrix(FreshFile("t.txt", "1 5\n8 2\n0 8\n"), 9);
  EXPECT_EQ(pairs.size(), 9);
  EXPECT_EQ(pairs.At(5, 1), LoopLabel::kLoop);
  EXPECT_EQ(pairs.At(8, 2), LoopLabel::kLoop);
  EXPECT_EQ(pairs.At(8, 0), LoopLabel::kLoop);
  EXPECT_EQ(pairs.RowsWithLoop(), 2);
  EXPECT_FALSE(Problem(FreshFile("t.txt", "1 5\n10 2\n0 8\n")).empty());
  EXPECT_FALSE(Problem(FreshFile("t.txt", "1 5\n2 10\n0 8\n")).empty());
  EXPECT_FALSE(Problem(FreshFile("t.txt", "1.5 5\n2 3\n0 8\n")).empty());
  EXPECT_FALSE(Problem(FreshFile("t.txt", "1 5.5\n2 3\n0 8\n")).empty());
}

TEST(LoopMatrix, NumbersAreLabelsWhereThereIsOneForEachPair) {
  const LoopGroundTruth truth = LoopsFromMatrix({0, 0, 0, 250, 0, 0, 249, 1, 0}, 3);
  EXPECT_EQ(truth.At(1, 0), LoopLabel::kLoop);
  EXPECT_EQ(truth.At(2, 0), LoopLabel::kIgnore);
  EXPECT_EQ(truth.At(2, 1), LoopLabel::kLoop);
  EXPECT_EQ(LoopsFromMatrix({}, 0).size(), 0);
  EXPECT_THROW(LoopsFromMatrix({0, 1, 0}, 2), InputError);
  EXPECT_THROW(LoopsFromMatrix({1}, -1), InputError);
}

TEST(LoopMatrix, BadFilesSayWhatIsWrongAndWhere) {
  EXPECT_NE(Problem("/nowhere/t.txt").find("can't be opened"), std::string::npos);
  EXPECT_NE(Problem(FreshFile("a.txt", "0 0\n0 x\n")).find("a.txt:2"), std::string::npos);
  EXPECT_NE(Problem(FreshFile("a.txt", "0 0 0\n0 0\n")).find("a.txt:2"), std::string::npos);
  EXPECT_NE(Problem(FreshFile("a.txt", "0 0 0\n0 0 0\n")).find("2 x 3"), std::string::npos);
  EXPECT_NE(Problem(FreshFile("a.txt", "0 -1\n0 0\n")).find("a.txt:1"), std::string::npos);
  EXPECT_NE(Problem(FreshFile("a.txt", "50 1\n6 2\n7 3\n")).find("50 1"), std::string::npos);
  // Found by fuzzing: the message made an integer of it.
  EXPECT_NE(Problem(FreshFile("a.txt", "444444444444444444444 4\n")).find("4.44444e+20 4"),
            std::string::npos);
  EXPECT_FALSE(Problem(FreshFile("a.txt", "")).empty());
  EXPECT_FALSE(Problem(FreshFile("a.txt", "# nothing\n")).empty());
  EXPECT_NE(Problem(FreshFile("a.mat", "MATLAB 5.0 MAT-file" + std::string(200, '\0'))).find("as text"),
            std::string::npos);
  EXPECT_FALSE(Problem(FreshFile("a.png", std::string("\x89PNG\r\n\x1a\n\0\0garbage", 17))).empty());
}

TEST(LoopMatrix, StridedKeepsEveryNthRowAndColumn) {
  LoopGroundTruth truth(10);
  truth.Set(8, 4, LoopLabel::kLoop);
  truth.Set(9, 3, LoopLabel::kLoop);
  const LoopGroundTruth strided = truth.Strided(4);
  EXPECT_EQ(strided.size(), 3);
  EXPECT_EQ(strided.At(2, 1), LoopLabel::kLoop);
  EXPECT_EQ(strided.RowsWithLoop(), 1);
}

TEST(LoopMatrix, FirstKeepsTheUpperLeftPart) {
  LoopGroundTruth truth(10);
  truth.Set(3, 1, LoopLabel::kLoop);
  truth.Set(9, 3, LoopLabel::kLoop);
  EXPECT_EQ(truth.First(4).size(), 4);
  EXPECT_EQ(truth.First(4).At(3, 1), LoopLabel::kLoop);
  EXPECT_EQ(truth.First(4).RowsWithLoop(), 1);
  EXPECT_EQ(truth.First(0).size(), 0);
  EXPECT_EQ(truth.First(99).size(), 10);
}

TEST(LoopMatrix, JoinedPairsTakeTheStrongestOfFourLabels) {
  LoopGroundTruth single(6);
  single.description = "singles.mat";
  single.Set(1, 0, LoopLabel::kLoop);    // left and right of one pair: no loop
  single.Set(4, 1, LoopLabel::kLoop);    // the way back: left against right
  single.Set(5, 0, LoopLabel::kIgnore);  // weaker than the loop above
  single.Set(5, 3, LoopLabel::kIgnore);
  const LoopGroundTruth pairs = single.PairsJoined();
  EXPECT_EQ(pairs.size(), 3);
  EXPECT_EQ(pairs.At(2, 0), LoopLabel::kLoop);
  EXPECT_EQ(pairs.At(2, 1), LoopLabel::kIgnore);
  EXPECT_EQ(pairs.At(1, 0), LoopLabel::kNone);
  EXPECT_EQ(pairs.RowsWithLoop(), 1);
  EXPECT_NE(pairs.description.find("joined"), std::string::npos);
}

TEST(LoopMatrix, OnlyThePastCounts) {
  LoopGroundTruth truth(5);
  truth.Set(1, 3, LoopLabel::kLoop);
  truth.Set(2, 2, LoopLabel::kLoop);
  EXPECT_EQ(truth.RowsWithLoop(), 0);
  EXPECT_EQ(truth.At(9, 0), LoopLabel::kNone);
  EXPECT_EQ(truth.At(3, -1), LoopLabel::kNone);
}

// Just within and just beyond each bound.
TEST(LoopsFromTrajectory, LabelsChangeAtTheBoundsOfTheRule) {
  LoopRule rule;
  rule.distance_m = 4;
  rule.angle_deg = 50;
  rule.exclude_s = 20;
  rule.ignore_m = 9;
  const auto label = [&](double seconds, double metres, double degrees) {
    const Pose first(ExpSO3({0.3, 0.2, 0.1}), {1, 2, 3});
    const Pose second = first * Pose(ExpSO3({0, degrees * M_PI / 180, 0}), {0.6 * metres, 0, 0.8 * metres});
    return LoopsFromTrajectory({{100, first}, {100 + seconds, second}}, rule).At(1, 0);
  };
  EXPECT_EQ(label(20, 3.9, 49), LoopLabel::kLoop);
  EXPECT_EQ(label(19.9, 3.9, 49), LoopLabel::kIgnore);
  EXPECT_EQ(label(19.9, 500, 0), LoopLabel::kIgnore);
  EXPECT_EQ(label(20, 4.1, 49), LoopLabel::kIgnore);
  EXPECT_EQ(label(20, 3.9, 51), LoopLabel::kIgnore);
  EXPECT_EQ(label(20, 8.9, 0), LoopLabel::kIgnore);
  EXPECT_EQ(label(20, 9.1, 0), LoopLabel::kNone);
  rule.ignore_m = 1;
  EXPECT_THROW(label(20, 3, 0), InputError);
}

TEST(LoopRule, OfValuesOutOfRangeIsRefused) {
  const auto refused = [](double distance, double angle, double exclude, double ignore) {
    LoopRule rule;
    rule.distance_m = distance;
    rule.angle_deg = angle;
    rule.exclude_s = exclude;
    rule.ignore_m = ignore;
    return !rule.Validate().empty();
  };
  EXPECT_FALSE(refused(4, 180, 0, 4));
  EXPECT_TRUE(refused(0, 180, 0, 4));
  EXPECT_TRUE(refused(4, 181, 0, 4));
  EXPECT_TRUE(refused(4, 0, 0, 4));
  EXPECT_TRUE(refused(4, 180, -1, 4));
  EXPECT_TRUE(refused(4, 180, 0, 3.9));
}

TEST(LoopsFromTrajectory, AgreesWithTheMatrixThatComesWithKitti) {
  TUTTI_REQUIRE_DATA(folder, "kitti_00_head");
  const Trajectory poses = ReadTrajectory(folder / "poses.txt", TrajectoryFormat::kKitti);
  const std::vector<double> times = ReadTimes(folder / "times.txt");
  Trajectory every_fifth;
  for (std::size_t i = 0; i < poses.size(); i += 5) every_fifth.push_back({times[i], poses[i].pose});
  const LoopGroundTruth derived = LoopsFromTrajectory(every_fifth, LoopRule());
  const LoopGroundTruth given = ReadLoopMatrix(folder / "loop_gt_stride5.png", 340);
  EXPECT_EQ(derived.RowsWithLoop(), 15);
  EXPECT_EQ(given.RowsWithLoop(), 15);
  int different = 0;
  for (int r = 0; r < 340; ++r) {
    for (int c = 0; c < r; ++c)
      different += (derived.At(r, c) == LoopLabel::kLoop) != (given.At(r, c) == LoopLabel::kLoop);
  }
  EXPECT_EQ(different, 0);
}

}  // namespace
}  // namespace tutti
