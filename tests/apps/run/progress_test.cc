// A line of progress fits the terminal and says when it will be over.
#include "apps/run/progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <sstream>

#include "tests/support/test_data.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

// What is written for the first half of `total` frames, in lines of `columns`.
std::string Written(std::size_t total, std::size_t columns, const std::string& status) {
  const std::filesystem::path file = testing::FreshFolder() / "progress";
  std::FILE* out = std::fopen(file.c_str(), "w");
  {
    Progress progress("slam", total, out, columns);
    for (std::size_t i = 1; i <= total / 2; ++i) progress.Update(i, status);
  }
  std::fclose(out);
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(Progress, SaysRateAndTimeLeft) {
  const std::string text = Written(1000, 120, "tracking  loops 1/2");
  EXPECT_THAT(text, HasSubstr("500/1000"));
  EXPECT_THAT(text, HasSubstr("/s  "));
  EXPECT_THAT(text, HasSubstr(" left  tracking  loops 1/2"));
}

TEST(Progress, NeverFillsTheLine) {
  std::istringstream lines(Written(100000, 60, std::string(200, 'x')));
  std::string line;
  int seen = 0;
  while (std::getline(lines, line)) {
    EXPECT_LT(line.size(), 60u) << line;
    ++seen;
  }
  EXPECT_GE(seen, 4);
}

TEST(Progress, SaysFiveTimesWhatHappensToManyFramesAndThenHowOften) {
  const std::filesystem::path file = testing::FreshFolder() / "progress";
  std::FILE* out = std::fopen(file.c_str(), "w");
  {
    Progress progress("slam", 100, out, 80);
    for (int i = 0; i < 59; ++i) {
      progress.Note("tutti: frame " + std::to_string(i) + " is skipped", "frames are skipped");
      progress.Note("tutti: something else");
    }
    progress.Note("tutti: frame 60 came late", "frames came late");
  }
  std::fclose(out);
  std::ifstream in(file);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  EXPECT_THAT(text, HasSubstr("frame 4 is skipped\n"));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("frame 5 is skipped")));
  EXPECT_THAT(text, HasSubstr("tutti: 54 more frames are skipped\n"));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("more frames came late")));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 5 + 59 + 1 + 1);
}

TEST(Progress, OfWorkThatCantBeCountedHasTheTimeInALineThatFits) {
  const std::filesystem::path file = testing::FreshFolder() / "progress";
  std::FILE* out = std::fopen(file.c_str(), "w");
  {
    Progress progress("solving", 0, out, 40);
    progress.Say("10000000 edges, iteration 0");  // too early for a line
    progress.Say("10000000 edges, iteration 1", 0);
  }
  std::fclose(out);
  std::ifstream in(file);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "solving 10000000 edges, iteration 1, 0 \n");
}

}  // namespace
}  // namespace tutti
