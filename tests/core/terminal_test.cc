// Text as wide as the terminal.
#include "core/terminal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <unistd.h>

namespace tutti::internal {
namespace {

using ::testing::ElementsAre;

TEST(Terminal, HasTheColumnsThatItSays) {
  int master = -1, slave = -1;
  winsize size{};
  size.ws_col = 133;
  ASSERT_EQ(openpty(&master, &slave, nullptr, nullptr, &size), 0);
  std::FILE* out = fdopen(slave, "w");
  ASSERT_NE(out, nullptr);
  EXPECT_EQ(TerminalColumns(out), 133u);
  size.ws_col = 0;
  ASSERT_EQ(ioctl(slave, TIOCSWINSZ, &size), 0);
  EXPECT_EQ(TerminalColumns(out), 80u);
  std::fclose(out);
  close(master);
}

TEST(Terminal, OfAFileHas80Columns) {
  std::FILE* file = std::tmpfile();
  ASSERT_NE(file, nullptr);
  EXPECT_EQ(TerminalColumns(file), 80u);
  EXPECT_EQ(TerminalColumns(nullptr), 80u);
  std::fclose(file);
}

TEST(Printable, NamesOfOthersDoNothingToATerminal) {
  EXPECT_EQ(Printable("a\x1b[2J\x07\tb.png: can't be read\n"), "a\\x1b[2J\\x07\\x09b.png: can't be read\n");
  EXPECT_EQ(Printable("name\ntutti: all is well"), "name\\ntutti: all is well");
  EXPECT_EQ(Printable("problems:\n  one\n  two"), "problems:\n  one\n  two");
  EXPECT_EQ(Printable("a table\x7f\nof lines\n", Breaks::kAll), "a table\\x7f\nof lines\n");
  EXPECT_EQ(Printable("gr\xc3\xbc\xc3\x9f \xe6\x9d\xb1 \xf0\x9f\x99\x82"),
            "gr\xc3\xbc\xc3\x9f \xe6\x9d\xb1 \xf0\x9f\x99\x82");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "2J \xe2\x80\xaegnp.exe"),
            "\\u009b2J \\u202egnp.exe");
  EXPECT_EQ(Printable("latin \xfc, cut \xe6\x9d"), "latin \\xfc, cut \\xe6\\x9d");
  EXPECT_EQ(Printable(std::string("zero\0 byte", 10)), "zero\\x00 byte");
  EXPECT_EQ(Printable(""), "");
}

TEST(WrapText, BreaksBetweenWordsAndFillsEachLine) {
  EXPECT_THAT(WrapText("one two three four", 9), ElementsAre("one two", "three", "four"));
  EXPECT_THAT(WrapText("one  two", 80), ElementsAre("one two"));
  EXPECT_THAT(WrapText("a verylongword b", 5), ElementsAre("a", "verylongword", "b"));
  EXPECT_THAT(WrapText("one\ntwo", 80), ElementsAre("one", "two"));
  EXPECT_THAT(WrapText("", 80), ElementsAre(""));
}

TEST(Message, IsBrokenBetweenWordsOnATerminalAlone) {
  int master = -1, slave = -1;
  winsize size{};
  size.ws_col = 24;
  ASSERT_EQ(openpty(&master, &slave, nullptr, nullptr, &size), 0);
  std::FILE* terminal = fdopen(slave, "w");
  EXPECT_EQ(Message("tutti: one two three four five", terminal), "tutti: one two three\n  four five\n");
  EXPECT_EQ(Message("\n  good:\n    * one two three four", terminal),
            "\n  good:\n    * one two three\n      four\n");
  std::fclose(terminal);
  close(master);
  std::FILE* file = std::tmpfile();
  const std::string text = "tutti: " + std::string(300, 'x') + " one two";
  EXPECT_EQ(Message(text, file), text + "\n") << "one line, for other programs";
  std::fclose(file);
}

}  // namespace
}  // namespace tutti::internal
