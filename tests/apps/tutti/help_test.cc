// --help, as wide as the terminal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/tutti/help.h"
#include "tests/apps/tutti/executable.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;
using testing::RunTutti;

std::size_t SpacesBefore(const std::string& line) {
  return std::min(line.find_first_not_of(' '), line.size());
}

TEST(Help, OfEveryCommandFitsAPipesColumns) {
  for (const char* name :
       {"", "run", "close", "localize", "merge", "map", "export", "calibrate-check", "evaluate", "convert",
        "plot", "compare", "collect", "loops", "compare-loops", "optimize", "generate", "demo"}) {
    std::vector<std::string> words = {name, "--help"};
    if (words[0].empty()) words.erase(words.begin());
    const auto run = RunTutti(words);
    ASSERT_EQ(run.status, 0) << run.output;
    const std::vector<std::string> lines = SplitText(run.output, "\n");
    ASSERT_GT(lines.size(), 3u) << name;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      EXPECT_LE(lines[i].size(), 80u) << name << ": " << lines[i];
      if (i == 0 || SpacesBefore(lines[i]) < 20 || SpacesBefore(lines[i]) != SpacesBefore(lines[i - 1]))
        continue;
      // A paragraph goes on: its next word had no room in the line before.
      const std::string word = SplitText(lines[i], " ").front();
      EXPECT_GT(lines[i - 1].size() + 1 + word.size(), 80u) << name << ": " << lines[i - 1];
    }
  }
}

TEST(Help, OfTheConfigurationFitsAPipesColumns) {
  const auto run = RunTutti({"run", "--help-config", "--advanced"});
  ASSERT_EQ(run.status, 0);
  for (const std::string& line : SplitText(run.output, "\n")) {
    const bool commented = line.find("# ") != std::string::npos;
    EXPECT_LE(commented ? line.size() : 0, 80u) << line;
  }
}

CLI::App* HelpOf(CLI::App& app, std::size_t columns) {
  static std::string value;
  app.formatter(std::make_shared<cli::WrappedHelp>(columns));
  CLI::App* command = app.add_subcommand("walk", "goes from one place to another, and back if it must");
  command->add_option("--way", value,
                      "the way that is gone, over hill and dale and whatever else there may be");
  return command;
}

TEST(Help, UsesTheWholeTerminal) {
  CLI::App wide("example", "example"), narrow("example", "example");
  EXPECT_THAT(
      HelpOf(wide, 200)->help(),
      HasSubstr("--way TEXT              the way that is gone, over hill and dale and whatever else there "
                "may be\n"));
  const std::string text = HelpOf(narrow, 40)->help();
  for (const std::string& line : SplitText(text, "\n")) EXPECT_LE(line.size(), 40u) << line;
  EXPECT_THAT(text, HasSubstr("  --way TEXT\n      the way that is gone, over hill\n"));
}

}  // namespace
}  // namespace tutti
