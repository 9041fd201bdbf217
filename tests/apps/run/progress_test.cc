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

// What is written in lines of `columns` while `work` goes on.
template <class Work>
std::string Written(const char* title, std::size_t total, std::size_t columns, const Work& work) {
  const std::filesystem::path file = testing::FreshFolder() / "progress";
  std::FILE* out = std::fopen(file.c_str(), "w");
  {
    Progress progress(title, total, out, columns);
    work(progress);
  }
  std::fclose(out);
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

// The first half of `total` frames.
std::string HalfOf(std::size_t total, std::size_t columns, const std::string& status) {
  return Written("slam", total, columns, [&](Progress& progress) {
    for (std::size_t i = 1; i <= total / 2; ++i) progress.Update(i, status);
  });
}

TEST(Progress, SaysRateAndTimeLeft) {
  const std::string text = HalfOf(1000, 120, "tracking  loops 1/2");
  EXPECT_THAT(text, HasSubstr("500/1000"));
  EXPECT_THAT(text, HasSubstr("/s  "));
  EXPECT_THAT(text, HasSubstr(" left  tracking  loops 1/2"));
}

TEST(Progress, NeverFillsTheLine) {
  std::istringstream lines(HalfOf(100000, 60, std::string(200, 'x')));
  std::string line;
  int seen = 0;
  while (std::getline(lines, line)) {
    EXPECT_LT(line.size(), 60u) << line;
    ++seen;
  }
  EXPECT_GE(seen, 4);
}

TEST(Progress, SaysFiveTimesWhatHappensToManyFramesAndThenHowOften) {
  const std::string text = Written("slam", 100, 80, [](Progress& progress) {
    for (int i = 0; i < 59; ++i) {
      progress.Note("tutti: frame " + std::to_string(i) + " is skipped", "frames are skipped");
      progress.Note("tutti: something else");
    }
    progress.Note("tutti: frame 60 came late", "frames came late");
  });
  EXPECT_THAT(text, HasSubstr("frame 4 is skipped\n"));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("frame 5 is skipped")));
  EXPECT_THAT(text, HasSubstr("tutti: 54 more frames are skipped\n"));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("more frames came late")));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 5 + 59 + 1 + 1);
}

TEST(Progress, OfWorkThatCantBeCountedHasTheTimeInALineThatFits) {
  EXPECT_EQ(Written("solving", 0, 40,
                    [](Progress& progress) {
                      progress.Say("10000000 edges, iteration 0");  // too early for a line
                      progress.Say("10000000 edges, iteration 1", 0);
                    }),
            "solving 10000000 edges, iteration 1, 0 \n");
}

}  // namespace
}  // namespace tutti
