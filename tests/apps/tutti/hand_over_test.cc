// `tutti` itself is small and starts quickly; the commands that read images are in tutti-images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <regex>

#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
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
  const auto all = RunTutti({"help"});
  EXPECT_EQ(all.status, 0);
  EXPECT_EQ(all.output, RunTutti({"--help"}).output);
  const std::regex line("\n  ([a-z-]+) +[^ \n]");
  const std::string commands = all.output.substr(all.output.find("Subcommands:"));
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
  EXPECT_EQ(count, 17);
}

TEST(Start, AnUnknownCommandIsRefusedWithTheNearest) {
  for (const std::string word : {"optimise", "rum"}) {
    const auto run = RunTutti({word});
    EXPECT_EQ(run.status, 1);
    EXPECT_THAT(run.output, AllOf(HasSubstr("there is no command '" + word + "'"),
                                  HasSubstr(word == "rum" ? "'run'" : "'optimize'")));
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

}  // namespace
}  // namespace tutti
