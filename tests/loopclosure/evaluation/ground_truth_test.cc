#include "tutti/loopclosure/ground_truth.h"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

fs::path WriteFile(const std::string& name, const std::string& content) {
  const fs::path file = testing::FreshFolder() / name;
  std::ofstream(file, std::ios::binary) << content;
  return file;
}

std::string Problem(const fs::path& file) {
  try {
    ReadLoopMatrix(file, 10);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(LoopMatrix, TextOfZerosAndOnes) {
  const LoopGroundTruth truth = ReadLoopMatrix(WriteFile("t.txt", "# comment\n0 0 0\n0 0 0\n1,0.5,0\n"), 3);
  EXPECT_EQ(truth.size(), 3);
  EXPECT_EQ(truth.At(2, 0), LoopLabel::kLoop);
  EXPECT_EQ(truth.At(2, 1), LoopLabel::kIgnore);
  EXPECT_EQ(truth.RowsWithLoop(), 1);
}

TEST(LoopMatrix, UpperTriangleIsTransposed) {
  const LoopGroundTruth truth = ReadLoopMatrix(WriteFile("t.txt", "0 0 255\n0 0 0\n0 0 0\n"), 3);
  EXPECT_EQ(truth.At(2, 0), LoopLabel::kLoop);
}

TEST(LoopMatrix, TextOfPairs) {
  const LoopGroundTruth truth = ReadLoopMatrix(WriteFile("t.txt", "5 1\n6 2\n7 3\n"), 10);
  EXPECT_EQ(truth.size(), 10);
  EXPECT_EQ(truth.At(6, 2), LoopLabel::kLoop);
  EXPECT_EQ(truth.RowsWithLoop(), 3);
}

TEST(LoopMatrix, ImagesWithWhiteGreyAndBlack) {
  cv::Mat image = cv::Mat::zeros(4, 4, CV_8U);
  image.at<std::uint8_t>(3, 0) = 255;
  image.at<std::uint8_t>(3, 1) = 128;
  const fs::path file = testing::FreshFolder() / "t.png";
  cv::imwrite(file.string(), image);
  const LoopGroundTruth truth = ReadLoopMatrix(file, 4);
  EXPECT_EQ(truth.At(3, 0), LoopLabel::kLoop);
  EXPECT_EQ(truth.At(3, 1), LoopLabel::kIgnore);
  EXPECT_EQ(truth.At(3, 2), LoopLabel::kNone);
}

TEST(LoopMatrix, BadFilesSayWhatIsWrongAndWhere) {
  EXPECT_NE(Problem("/nowhere/t.txt").find("can't be opened"), std::string::npos);
  EXPECT_NE(Problem(WriteFile("a.txt", "0 0\n0 x\n")).find("a.txt:2"), std::string::npos);
  EXPECT_NE(Problem(WriteFile("a.txt", "0 0 0\n0 0\n")).find("a.txt:2"), std::string::npos);
  EXPECT_NE(Problem(WriteFile("a.txt", "0 0 0\n0 0 0\n")).find("2 x 3"), std::string::npos);
  EXPECT_NE(Problem(WriteFile("a.txt", "0 -1\n0 0\n")).find("a.txt:1"), std::string::npos);
  EXPECT_NE(Problem(WriteFile("a.txt", "50 1\n6 2\n7 3\n")).find("50 1"), std::string::npos);
  EXPECT_FALSE(Problem(WriteFile("a.txt", "")).empty());
  EXPECT_FALSE(Problem(WriteFile("a.txt", "# nothing\n")).empty());
  EXPECT_FALSE(Problem(WriteFile("a.png", std::string("\x89PNG\r\n\x1a\n\0\0garbage", 18))).empty());
}

// Found by fuzzing (tests/fuzz): the message made an integer of it.
TEST(LoopMatrix, APairBeyondAllIntegersIsAnErrorThatShowsIt) {
  EXPECT_NE(Problem(WriteFile("t.txt", "444444444444444444444 4\n")).find("4.44444e+20 4"),
            std::string::npos);
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

// Column-major doubles, uncompressed, as MATLAB's save -v6 writes them.
std::string SmallMatFile(const std::vector<double>& values, std::int32_t rows, std::int32_t columns) {
  const auto word = [](std::int32_t value) { return std::string(reinterpret_cast<const char*>(&value), 4); };
  std::string data;
  for (const double value : values) data += std::string(reinterpret_cast<const char*>(&value), 8);
  const std::string body = word(6) + word(8) + word(6) + word(0) +           // flags: class double
                           word(5) + word(8) + word(rows) + word(columns) +  // dimensions
                           word(1) + word(5) + std::string("truth\0\0\0", 8) + word(9) +
                           word(static_cast<std::int32_t>(data.size())) + data;
  std::string header = "MATLAB 5.0 MAT-file";
  header.resize(124, ' ');
  return header + std::string("\x00\x01IM", 4) + word(14) + word(static_cast<std::int32_t>(body.size())) +
         body;
}

TEST(LoopMatrix, MatlabValuesAreColumnMajor) {
  const LoopGroundTruth truth =
      ReadLoopMatrix(WriteFile("t.mat", SmallMatFile({0, 0, 0.5, 0, 0, 1, 0, 0, 0}, 3, 3)), 3);
  EXPECT_EQ(truth.At(2, 0), LoopLabel::kIgnore);
  EXPECT_EQ(truth.At(2, 1), LoopLabel::kLoop);
  const LoopGroundTruth transposed =
      ReadLoopMatrix(WriteFile("u.mat", SmallMatFile({0, 0, 0, 0, 0, 0, 0.5, 1, 0}, 3, 3)), 3);
  EXPECT_EQ(transposed.At(2, 0), LoopLabel::kIgnore);
  EXPECT_EQ(transposed.At(2, 1), LoopLabel::kLoop);
  EXPECT_FALSE(Problem(WriteFile("v.mat", SmallMatFile({0, 0, 0, 0, 0, 0}, 3, 2))).empty());
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

TEST(LoopMatrix, PublishedMatlabFilesAreRead) {
  TUTTI_REQUIRE_DATA(folder, "loop_gt");
  const LoopGroundTruth indoor = ReadLoopMatrix(folder / "Lip6IndoorGroundTruth.mat", 388);
  EXPECT_EQ(indoor.size(), 388);
  EXPECT_GT(indoor.RowsWithLoop(), 100);
  EXPECT_EQ(ReadLoopMatrix(folder / "Lip6OutdoorGroundTruth.mat", 1063).size(), 1063);
  EXPECT_EQ(ReadLoopMatrix(folder / "city_centre_htmap.mat", 1237).size(), 1237);
  EXPECT_EQ(ReadLoopMatrix(folder / "city_GT_final.mat", 1237).size(), 1237);
}

TEST(LoopMatrix, DamagedMatlabFilesAreErrorsAndNothingElse) {
  TUTTI_REQUIRE_DATA(file, "loop_gt/Lip6IndoorGroundTruth.mat");
  std::ifstream in(file, std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  for (const std::size_t length : {11u, 100u, 127u, 128u, 135u, 140u, 700u, 1900u}) {
    EXPECT_FALSE(Problem(WriteFile("cut.mat", good.substr(0, length))).empty()) << length;
  }
  for (std::size_t i = 128; i < good.size(); i += 37) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x5a);
    try {
      ReadLoopMatrix(WriteFile("bad.mat", bad), 388);
    } catch (const InputError&) {
    }
  }
}

// One element of a MATLAB v5 file: type, length, data, padding to 8 bytes.
template <typename T>
std::string MatElement(std::uint32_t type, const std::vector<T>& data) {
  const std::uint32_t tag[2] = {type, static_cast<std::uint32_t>(data.size() * sizeof(T))};
  std::string bytes(sizeof tag + (tag[1] + 7) / 8 * 8, '\0');
  std::memcpy(bytes.data(), tag, sizeof tag);
  std::memcpy(bytes.data() + sizeof tag, data.data(), tag[1]);
  return bytes;
}

// A file with one variable of these elements.
fs::path MatFile(const std::string& content) {
  constexpr std::uint32_t kMatrix = 14;
  std::string header = "MATLAB 5.0 MAT-file";
  header.resize(124, ' ');
  return WriteFile("t.mat", header + std::string("\0\1IM", 4) +
                                MatElement(kMatrix, std::vector<char>(content.begin(), content.end())));
}

TEST(LoopMatrix, MatlabNumbersThatNoIntegerHoldsAreErrors) {
  constexpr std::uint32_t kInt8 = 1, kInt32 = 5, kUint32 = 6, kDouble = 9;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string size = MatElement<std::int32_t>(kInt32, {2, 2}),
                    name = MatElement<char>(kInt8, {'g', 't'});
  const std::string full = MatElement<double>(kDouble, {0, 1, 0, 0});
  constexpr std::uint32_t kDoubleClass = 6, kSparseClass = 5;
  EXPECT_EQ(Problem(MatFile(MatElement<std::uint32_t>(kUint32, {kDoubleClass, 0}) + size + name + full)), "");
  for (const double flags : {nan, -1.0, 1e300}) {
    EXPECT_NE(Problem(MatFile(MatElement<double>(kDouble, {flags}) + size + name + full)).find("flags"),
              std::string::npos)
        << flags;
  }
  for (const double start : {nan, -1.0, 1e300}) {
    const std::string sparse = MatElement<std::uint32_t>(kUint32, {kSparseClass, 0}) + size + name +
                               MatElement<std::int32_t>(kInt32, {1}) +
                               MatElement<double>(kDouble, {0, start, 1}) + MatElement<double>(kDouble, {1});
    EXPECT_NE(Problem(MatFile(sparse)).find("column starts"), std::string::npos) << start;
  }
}

TEST(LoopsFromTrajectory, FollowsTheStatedRule) {
  Trajectory trajectory;
  const auto add = [&](double t, double x, double degrees) {
    trajectory.push_back({t, Pose(ExpSO3({0, degrees * 3.14159265358979 / 180, 0}), {x, 0, 0})});
  };
  add(0, 0, 0);
  add(5, 3, 0);     // near, but too young
  add(20, 2, 10);   // loop with 0 and 1
  add(40, 2, 90);   // near, turned away: ignored
  add(60, 12, 0);   // within the ignored distance
  add(80, 100, 0);  // elsewhere
  const LoopGroundTruth truth = LoopsFromTrajectory(trajectory, LoopRule());
  EXPECT_EQ(truth.At(1, 0), LoopLabel::kIgnore);
  EXPECT_EQ(truth.At(2, 0), LoopLabel::kLoop);
  EXPECT_EQ(truth.At(2, 1), LoopLabel::kLoop);
  EXPECT_EQ(truth.At(3, 0), LoopLabel::kIgnore);
  EXPECT_EQ(truth.At(4, 0), LoopLabel::kIgnore);
  EXPECT_EQ(truth.At(5, 0), LoopLabel::kNone);
  LoopRule bad;
  bad.ignore_m = 1;
  EXPECT_THROW(LoopsFromTrajectory(trajectory, bad), InputError);
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
