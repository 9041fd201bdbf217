#include "core/time_stamps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tutti::internal {
namespace {

using ::testing::ElementsAre;

std::vector<double> Every(double interval, double from = 0, int count = 20) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(from + interval * i);
  return values;
}

std::vector<std::size_t> Order(const StampsOfNames& found) {
  std::vector<std::size_t> order;
  for (const auto& stamp : found.stamps) order.push_back(stamp.second);
  return order;
}

TEST(TimeStamps, TimesSince1970ShowTheirUnitBySize) {
  const std::vector<StampUnit> units = {StampUnit::kSeconds, StampUnit::kMilliseconds,
                                        StampUnit::kMicroseconds, StampUnit::kNanoseconds};
  for (const StampUnit unit : units) {
    const double one = 1 / SecondsOf(unit);
    for (const StampUnit expected : units) {
      EXPECT_EQ(UnitOfStamps(Every(0.05 * one, 1403636579.763 * one), expected).unit, unit);
      EXPECT_EQ(UnitOfStamps({1403636579.763 * one}, expected).unit, unit);
    }
  }
  EXPECT_EQ(UnitOfStamps(Every(900, 1.4e9)).unit, StampUnit::kSeconds);  // a photo every quarter of an hour
}

TEST(TimeStamps, TimesSinceAnyStartShowTheirUnitBySpacing) {
  for (const double interval_s : {0.005, 0.0333, 0.05, 0.1, 0.5}) {
    EXPECT_EQ(UnitOfStamps(Every(interval_s)).unit, StampUnit::kSeconds) << interval_s;
    EXPECT_EQ(UnitOfStamps(Every(1e6 * interval_s)).unit, StampUnit::kMicroseconds) << interval_s;
    EXPECT_EQ(UnitOfStamps(Every(1e9 * interval_s)).unit, StampUnit::kNanoseconds) << interval_s;
    EXPECT_EQ(UnitOfStamps(Every(1e9 * interval_s, 84213457812345)).unit, StampUnit::kNanoseconds);
    EXPECT_EQ(UnitOfStamps(Every(1e9 * interval_s, -1e9)).unit, StampUnit::kNanoseconds);
    if (interval_s > 0.01) {
      EXPECT_EQ(UnitOfStamps(Every(1e3 * interval_s)).unit, StampUnit::kMilliseconds) << interval_s;
    }
  }
  EXPECT_EQ(UnitOfStamps(Every(1)).unit, StampUnit::kSeconds);  // numbers of frames
  // A tracker at 200 Hz beside images whose milliseconds are clear.
  EXPECT_EQ(UnitOfStamps(Every(5), StampUnit::kMilliseconds).unit, StampUnit::kMilliseconds);
}

TEST(TimeStamps, NumbersOfKeyframesAreNoMillisecondsWhereTheOtherFileCountsFrames) {
  EXPECT_FALSE(UnitOfStamps(Every(15)).certain);
  for (const double others_end_s : {299.0, 0.3}) {
    TrajectoryDetails details;
    details.unit = UnitOfStamps(Every(15)).unit;
    details.unit_is_certain = false;
    Trajectory poses = {{0, Pose()}, {0.285, Pose()}};
    FitUnit({0, others_end_s}, poses, details, nullptr);
    EXPECT_NEAR(poses.back().stamp_s, others_end_s > 1 ? 285 : 0.285, 1e-9);
  }
}

TEST(TimeStamps, AreKeptToTheNanosecond) {
  EXPECT_EQ(NanosecondsOf("1403636579763555584.000000", StampUnit::kNanoseconds), 1403636579763555584);
  EXPECT_EQ(NanosecondsOf("1403636579.763555527", StampUnit::kSeconds), 1403636579763555527);
  EXPECT_EQ(NanosecondsOf("-0.5", StampUnit::kSeconds), -500000000);
  EXPECT_EQ(NanosecondsOf("1403636579763.25", StampUnit::kMilliseconds), 1403636579763250000);
  EXPECT_EQ(NanosecondsOf("7", StampUnit::kMicroseconds), 7000);
  EXPECT_EQ(NanosecondsOf("1.5e9", StampUnit::kNanoseconds), 1500000000);
  EXPECT_EQ(NanosecondsOf("0.0000000016", StampUnit::kSeconds), 2);
  EXPECT_FALSE(NanosecondsOf("9300000000", StampUnit::kSeconds));
  EXPECT_FALSE(NanosecondsOf("1e80", StampUnit::kNanoseconds));
  EXPECT_FALSE(NanosecondsOf("x", StampUnit::kSeconds));
  EXPECT_EQ(StampText(std::int64_t{1403636579763555584}), "1403636579.763555584");
  EXPECT_EQ(StampText(std::int64_t{-500000000}), "-0.500000000");
}

TEST(TimeStamps, OfNamesAreSortedByValueAndInSeconds) {
  const auto found = FindStamps({"1403636579813555456", "1403636579763555584"});
  EXPECT_EQ(found.unit, StampUnit::kNanoseconds);
  EXPECT_THAT(Order(found), ElementsAre(1, 0));
  EXPECT_NEAR(found.stamps[0].first, 1403636579.763555584, 1e-6);
  EXPECT_THAT(Order(FindStamps({"-50000000", "-100000000", "0", "50000000"})), ElementsAre(1, 0, 2, 3));
  EXPECT_THAT(Order(FindStamps({"1403636579.8", "1403636579.75", "1403636580"})), ElementsAre(1, 0, 2));
  EXPECT_THAT(Order(FindStamps({"frame_1403636579763555584", "frame_1403636579713555584"})),
              ElementsAre(1, 0));
  EXPECT_THAT(Order(FindStamps({"cam0-1403636579.763556-left", "cam0-1403636579.5-left"})),
              ElementsAre(1, 0));
  EXPECT_THAT(Order(FindStamps({"0.1", "overview", "0.2"})), ElementsAre(0, 2));
}

TEST(TimeStamps, NumbersOfFramesAndDatesInNamesAreNone) {
  for (const std::vector<std::string>& names :
       std::vector<std::vector<std::string>>{{"0000000000", "0000000001"},
                                             {"frame-000000.color", "frame-000001.color"},
                                             {"1", "2", "10"},
                                             {"IMG_20240229_101010", "IMG_20240229_101011"},
                                             {"IMG_20240229_101010123", "IMG_20240229_101011456"},
                                             {"20240229101010", "20240229101011"},
                                             {"a", "b"},
                                             {"0.5", "0.50"},
                                             {}}) {
    EXPECT_TRUE(FindStamps(names).stamps.empty()) << (names.empty() ? "" : names[0]);
  }
}

}  // namespace
}  // namespace tutti::internal
