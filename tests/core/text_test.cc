#include "tutti/core/text.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tutti {
namespace {

TEST(Text, SplitsAndDropsEmptyPieces) {
  EXPECT_EQ(SplitText("  a, b\t\tc\r"), (std::vector<std::string>{"a", "b", "c"}));
  EXPECT_TRUE(SplitText(" ,, ").empty());
}

TEST(Text, JoinsWithNothingBeforeTheFirstAndAfterTheLast) {
  EXPECT_EQ(JoinText({}), "");
  EXPECT_EQ(JoinText({"a"}), "a");
  EXPECT_EQ(JoinText({"a", "b", "c"}), "a, b, c");
  EXPECT_EQ(JoinText({"-h", "--help"}, "|"), "-h|--help");
}

TEST(Text, ParsesWholeNumbersOnly) {
  EXPECT_EQ(ParseDouble("1e-3"), 1e-3);
  EXPECT_EQ(ParseDouble("+2.5"), 2.5);
  EXPECT_TRUE(std::isnan(*ParseDouble("nan")));
  for (const char* bad : {"", "x", "1.5m", "1 2", "--1", "0x10"})
    EXPECT_FALSE(ParseDouble(bad).has_value()) << bad;
  EXPECT_EQ(ParseInteger("-17"), -17);
  for (const char* bad : {"", "1.0", "99999999999999999999", "seven"})
    EXPECT_FALSE(ParseInteger(bad).has_value()) << bad;
}

TEST(Text, NaturalOrderComparesNumbers) {
  std::vector<std::string> names = {"10.jpg", "2.jpg", "1.jpg", "frame007", "frame7", "frame10"};
  std::sort(names.begin(), names.end(), NaturalLess);
  EXPECT_EQ(names, (std::vector<std::string>{"1.jpg", "2.jpg", "10.jpg", "frame007", "frame7", "frame10"}));
  EXPECT_FALSE(NaturalLess("a1", "a1"));
}

TEST(Text, FindsTheNearestWord) {
  EXPECT_EQ(NearestWord("chordl", {"file", "chordal", "auto"}), "chordal");
  EXPECT_EQ(NearestWord("x", {}), "");
}

}  // namespace
}  // namespace tutti
