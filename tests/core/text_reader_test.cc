#include "core/text_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

namespace tutti::internal {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;

class TextReaderTest : public ::testing::Test {
 protected:
  fs::path File(const std::string& text) const {
    std::ofstream(folder_ / "file.txt", std::ios::binary) << text;
    return folder_ / "file.txt";
  }
  static std::vector<std::string> Lines(const fs::path& file) {
    TextReader in(file);
    std::vector<std::string> lines;
    for (std::string line; in.Next(line);) {
      lines.push_back(line);
      EXPECT_EQ(in.number(), lines.size());
    }
    return lines;
  }
  static std::string Problem(const fs::path& file) {
    return tutti::testing::ErrorOf([&file] { Lines(file); });
  }

  const fs::path folder_ = tutti::testing::FreshFolder();
};

TEST_F(TextReaderTest, GivesEachLineOnceWithOrWithoutALastLineFeed) {
  EXPECT_THAT(Lines(File("")), ElementsAre());
  EXPECT_THAT(Lines(File("\n")), ElementsAre(""));
  EXPECT_THAT(Lines(File("a\n\nb c\r\n")), ElementsAre("a", "", "b c\r"));
  EXPECT_THAT(Lines(File("a\nb")), ElementsAre("a", "b"));
}

TEST_F(TextReaderTest, TheMarkOfUtf8IsNoPartOfTheFirstLine) {
  EXPECT_THAT(Lines(File("\xEF\xBB\xBF"
                         "a\n\xEF\xBB\xBF"
                         "b\n")),
              ElementsAre("a",
                          "\xEF\xBB\xBF"
                          "b"));
  EXPECT_THAT(Lines(File("\xEF\xBB")), ElementsAre("\xEF\xBB"));
}

TEST_F(TextReaderTest, LinesMayBeLongerThanTheBlocksThatAreRead) {
  constexpr std::size_t kBlock = 65536;
  std::vector<std::string> lines;
  std::string text;
  for (const std::size_t size : {kBlock - 1, kBlock, kBlock + 1, std::size_t{0}, 3 * kBlock + 7}) {
    lines.emplace_back(size, static_cast<char>('a' + lines.size()));
    text += lines.back() + "\n";
  }
  EXPECT_EQ(Lines(File(text)), lines);
}

TEST_F(TextReaderTest, WhatIsNoTextIsRefusedAtItsFirstZeroByte) {
  const fs::path utf16 = File(std::string("1\0 \0", 4));
  EXPECT_THAT(Problem(utf16), HasSubstr(utf16.string() + ":1: holds zero bytes"));
  EXPECT_THAT(Problem("/dev/zero"), HasSubstr("/dev/zero:1: holds zero bytes"));
  const fs::path sparse = File("1 2\n");
  fs::resize_file(sparse, 300'000'000'000ULL);
  EXPECT_THAT(Problem(sparse), HasSubstr(":2: holds zero bytes"));
}

TEST_F(TextReaderTest, ALineBeyondAllReasonIsRefused) {
  EXPECT_THAT(Problem(File("1\n" + std::string(TextReader::kMostLineBytes + 1, '2'))),
              HasSubstr(":2: this line is longer than 64 MiB"));
  EXPECT_EQ(Lines(File(std::string(TextReader::kMostLineBytes, '2') + "\n1")).size(), 2U);
}

TEST_F(TextReaderTest, NobodyWaitsAtAPipe) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(Problem(pipe), HasSubstr("is a pipe, not a file"));
}

TEST_F(TextReaderTest, APipeOfTheShellIsRead) {
  int ends[2] = {};
  ASSERT_EQ(pipe(ends), 0);
  ASSERT_EQ(write(ends[1], "a\nb\n", 4), 4);
  close(ends[1]);
  EXPECT_THAT(Lines("/dev/fd/" + std::to_string(ends[0])), ElementsAre("a", "b"));
  close(ends[0]);
}

TEST_F(TextReaderTest, FoldersAndMissingFilesAreSaidWithTheAdvice) {
  const auto problem = [](const fs::path& file) {
    return tutti::testing::ErrorOf([&file] { TextReader(file, "give a list"); });
  };
  EXPECT_THAT(problem(folder_), EndsWith(": is a folder; give a list"));
  EXPECT_THAT(problem(folder_ / "none"), EndsWith("none: can't be opened; give a list"));
}

TEST_F(TextReaderTest, AWholeTextHasABound) {
  EXPECT_EQ(ReadText(File("a\nb"), "", 4), "a\nb\n");
  EXPECT_THAT(tutti::testing::ErrorOf([this] { ReadText(File("a\nb\n"), "give another", 3); }),
              EndsWith("MB; give another"));
}

}  // namespace
}  // namespace tutti::internal
