// `tutti` itself is small and starts quickly; the commands that read images are in tutti-images. --help is as
// wide as the terminal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <regex>

#include "apps/tutti/help.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::RunProgramAndSignal;
using testing::RunTutti;
using ::testing::StartsWith;

// A copy of `tutti` alone in a folder, and what stands there for tutti-images.
class HandOver : public ::testing::Test {
 protected:
  HandOver() {
    fs::create_directories(folder_);
    fs::copy_file(TUTTI_EXECUTABLE, tutti_);
  }
  void Other(const std::string& script) const {
    testing::WriteAll(folder_ / "tutti-images", "#!/bin/sh\n" + script);
    fs::permissions(folder_ / "tutti-images", fs::perms::owner_all);
  }
  const fs::path folder_ = testing::FreshFolder() / "bin";
  const fs::path tutti_ = folder_ / "tutti";
};

TEST(Start, TheProgramLoadsNoImageReaders) {
  const testing::ProcessResult ldd = RunProgramAndSignal("/usr/bin/ldd", {TUTTI_EXECUTABLE}, "", 0);
  const std::string& libraries = ldd.output;
  ASSERT_EQ(ldd.status, 0) << libraries;
  EXPECT_THAT(libraries, HasSubstr("libc.so"));
  for (const char* name :
       {"opencv_imgcodecs", "opencv_videoio", "opencv_dnn", "opencv_features2d", "libgdal", "libmatio"})
    EXPECT_THAT(libraries, Not(HasSubstr(name)));
}

TEST(Start, EveryCommandOfTheHelpExplainsItselfInEitherWay) {
  const std::string all = Done(RunTutti({"help"}));
  EXPECT_EQ(all, RunTutti({"--help"}).output);
  const std::regex line("\n  ([a-z-]+) +[^ \n]");
  const std::string commands = all.substr(all.find("Subcommands:"));
  int count = 0;
  for (std::sregex_iterator it(commands.begin(), commands.end(), line), end; it != end; ++it) {
    const std::string name = (*it)[1];
    const auto help = RunTutti({name, "--help"});
    EXPECT_EQ(help.status, 0) << name;
    if (name == "help") continue;
    ++count;
    EXPECT_THAT(help.output, HasSubstr("Usage: tutti " + name)) << name;
    EXPECT_EQ(help.output, RunTutti({"help", name}).output);
  }
  EXPECT_EQ(count, 18);
}

TEST(Start, AnUnknownCommandIsRefusedWithTheNearest) {
  for (const std::string word : {"optimise", "rum"}) {
    ExpectRefusal(RunTutti({word}),
                  {"there is no command '" + word + "'", word == "rum" ? "'run'" : "'optimize'"});
  }
  EXPECT_EQ(RunTutti({}).status, 1);
}

TEST_F(HandOver, WithoutTheOtherProgramItSaysWhereItLooked) {
  const auto run = RunProgramAndSignal(tutti_, {"run", "--help"}, "", 0);
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output,
              AllOf(StartsWith("tutti: 'run' needs the program tutti-images"),
                    HasSubstr((fs::canonical(folder_) / "tutti-images").string()), HasSubstr("libexec")));
  EXPECT_EQ(RunProgramAndSignal(tutti_, {"--version"}, "", 0).status, 0);
}

TEST_F(HandOver, ArgumentsOutputAndExitStatusAreThoseOfTheOtherProgram) {
  Other("printf '%s|' \"$@\"\nexit 37\n");
  const auto run =
      RunProgramAndSignal(tutti_, {"loops", "--set", "a b=c", "run", "--help", "--version", "*"}, "", 0);
  EXPECT_EQ(run.status, 37);
  EXPECT_EQ(run.output, "loops|--set|a b=c|run|--help|--version|*|");
}

TEST_F(HandOver, CtrlCReachesTheOtherProgramAlone) {
  Other("trap 'echo stopped; exit 42' INT\necho ready\nwhile :; do sleep 0.05; done\n");
  const auto run = RunProgramAndSignal(tutti_, {"run"}, "ready", SIGINT);
  EXPECT_EQ(run.status, 42);
  EXPECT_EQ(run.output, "ready\nstopped\n");
}

std::size_t SpacesBefore(const std::string& line) {
  return std::min(line.find_first_not_of(' '), line.size());
}

TEST(Help, OfEveryCommandFitsAPipesColumns) {
  for (const char* name :
       {"", "run", "close", "localize", "merge", "map", "export", "calibrate-check", "evaluate", "convert",
        "plot", "compare", "collect", "loops", "compare-loops", "optimize", "generate", "demo"}) {
    std::vector<std::string> words = {name, "--help"};
    if (words[0].empty()) words.erase(words.begin());
    const std::string run = Done(RunTutti(words));
    const std::vector<std::string> lines = SplitText(run, "\n");
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
  const std::string run = Done(RunTutti({"run", "--help-config", "--advanced"}));
  for (const std::string& line : SplitText(run, "\n")) {
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
