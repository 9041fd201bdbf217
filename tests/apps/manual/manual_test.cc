// The man page and the completion, made from a program with two commands.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/manual/command_page.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

using manual::Argument;
using manual::CommandPage;
using ::testing::HasSubstr;
using ::testing::Not;

Argument Option(const std::string& name, const std::string& value, const std::string& text) {
  Argument argument;
  argument.names = {name};
  argument.value = value;
  argument.text = text;
  return argument;
}

CommandPage Program() {
  CommandPage draw;
  draw.name = "draw";
  draw.text = "lines";
  draw.footer = "Example:\n.5 draw --title 'a\\b'";
  draw.arguments = {Option("--out", "TEXT", "it's the file"), Option("--width", "INT", "[px]"),
                    Option("--quiet", "", "no words"), Option("--style", "TEXT", "dots: none")};
  draw.arguments[1].default_value = "-1";
  draw.arguments[3].choices = {"thin", "thick"};
  Argument input = Option("input", "TEXT", "what to draw");
  input.positional = input.required = input.several = true;
  draw.arguments.push_back(input);
  CommandPage program;
  program.name = "pen";
  program.text = "pen: draws";
  program.arguments = {Option("--version", "", "print it")};
  program.commands = {draw};
  return program;
}

TEST(ManPage, HasEveryOptionWithItsDefaultAndChoices) {
  const std::string page = manual::ManPage(Program(), "pen 1.2");
  EXPECT_THAT(page, HasSubstr(".TH \"pen\" 1 \"\" \"pen 1.2\""));
  EXPECT_THAT(page, HasSubstr("pen \\- draws\n"));
  EXPECT_THAT(page, HasSubstr(".TP\n\\fB\\-\\-out\\fR \\fITEXT\\fR\nit's the file\n"));
  EXPECT_THAT(page, HasSubstr("Default: \\-1."));
  EXPECT_THAT(page, HasSubstr("One of: thin, thick."));
  EXPECT_THAT(page, HasSubstr("\\fBpen draw\\fR [\\fIoptions\\fR] \\fIinput\\fR ..."));
}

TEST(ManPage, TakesNoTextForAMacro) {
  const std::string page = manual::ManPage(Program(), "pen 1.2");
  EXPECT_THAT(page, HasSubstr("\n\\&.5 draw \\-\\-title 'a\\eb'"));
  EXPECT_THAT(page, Not(HasSubstr("\n.5")));
}

// The words that bash offers for the last one.
std::string Offered(const std::filesystem::path& script, const std::string& words, int last) {
  const std::string call = "bash -c 'cd " + script.parent_path().string() + " && source " + script.string() +
                           "; COMP_WORDS=(" + words + "); COMP_CWORD=" + std::to_string(last) +
                           "; _pen; echo \"${COMPREPLY[*]}\"'";
  FILE* pipe = popen(call.c_str(), "r");
  std::string out(256, '\0');
  out.resize(fread(out.data(), 1, out.size(), pipe));
  pclose(pipe);
  out.erase(out.find_last_not_of('\n') + 1);
  return out;
}

TEST(BashCompletion, OffersCommandsOptionsChoicesAndFiles) {
  const std::filesystem::path folder = testing::FreshFolder();
  const std::filesystem::path script = folder / "pen";
  testing::WriteAll(script, manual::BashCompletion(Program()));
  testing::WriteAll(folder / "a file.txt", "");
  EXPECT_EQ(Offered(script, "pen \"\"", 1), "draw --version");
  EXPECT_EQ(Offered(script, "pen d", 1), "draw");
  EXPECT_EQ(Offered(script, "pen draw --", 2), "--out --width --quiet --style");
  EXPECT_EQ(Offered(script, "pen draw --style thi", 3), "thin thick");
  EXPECT_EQ(Offered(script, "pen draw --out a", 3), "a file.txt");
  EXPECT_EQ(Offered(script, "pen draw --width \"\"", 3), "") << "nothing to guess a number from";
  EXPECT_EQ(Offered(script, "pen draw --quiet a", 3), "a file.txt") << "a positional argument";
}

TEST(Describe, SaysWhatACommandTakesWithoutItsRequiredOptions) {
  const testing::ProcessResult said = testing::RunTutti({"convert", "--describe"});
  ASSERT_EQ(said.status, 0) << said.output;
  const CommandPage page = manual::ParsePage(said.output);
  EXPECT_EQ(page.name, "convert");
  const auto named = [&](const std::string& name) {
    for (const Argument& argument : page.arguments) {
      if (argument.names.back() == name) return argument;
    }
    ADD_FAILURE() << name << " is not in it";
    return Argument();
  };
  EXPECT_TRUE(named("input").positional);
  EXPECT_TRUE(named("--to").required);
  EXPECT_EQ(named("--to").choices, std::vector<std::string>({"tum", "kitti", "euroc", "g2o"}));
  EXPECT_EQ(named("--from").default_value, "auto");
  EXPECT_EQ(named("--help").value, "");
  EXPECT_TRUE(named("--times").IsPath());
}

TEST(Describe, OfTheProgramListsItsCommands) {
  const testing::ProcessResult said = testing::RunTutti({"--describe"});
  ASSERT_EQ(said.status, 0) << said.output;
  const CommandPage page = manual::ParsePage(said.output);
  std::string names;
  for (const CommandPage& command : page.commands) names += command.name + " ";
  EXPECT_THAT(names, HasSubstr("run "));
  EXPECT_THAT(names, HasSubstr("demo "));
  EXPECT_THAT(testing::RunTutti({"--help"}).output, Not(HasSubstr("--describe")));
}

}  // namespace
}  // namespace tutti
