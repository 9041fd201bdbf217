// One rule for all files that are written.
#include "core/replaced_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <future>
#include <iterator>
#include <string>

#include "tests/support/error_of.h"
#include "tests/support/full_disk.h"
#include "tests/support/test_data.h"

namespace tutti::internal {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using tutti::testing::BytesOf;
using tutti::testing::ErrorOf;

class ReplacedFileTest : public ::testing::Test {
 protected:
  static std::ptrdiff_t Entries(const fs::path& folder) {
    return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
  }
  const fs::path folder_ = tutti::testing::FreshFolder(), file_ = folder_ / "file";
};

TEST_F(ReplacedFileTest, KeepsItsModeAndALinkLeadsToTheFileThatIsWritten) {
  WriteFile(file_, "old");
  fs::permissions(file_, fs::perms::owner_read | fs::perms::owner_write);
  fs::create_directory(folder_ / "links");
  fs::create_symlink("../file", folder_ / "links" / "one");
  fs::create_symlink(folder_ / "links" / "one", folder_ / "links" / "two");
  WriteFile(folder_ / "links" / "two", "new");
  EXPECT_EQ(BytesOf(file_), "new");
  EXPECT_EQ(fs::status(file_).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_TRUE(fs::is_symlink(folder_ / "links" / "two"));
  fs::create_symlink("not there yet", folder_ / "links" / "three");
  WriteFile(folder_ / "links" / "three", "made");
  EXPECT_EQ(BytesOf(folder_ / "links" / "not there yet"), "made");
  fs::create_symlink("round", folder_ / "links" / "round");
  EXPECT_THAT(ErrorOf([&] { WriteFile(folder_ / "links" / "round", "x"); }), HasSubstr("can't be written"));
  EXPECT_EQ(Entries(folder_ / "links"), 5);
}

TEST_F(ReplacedFileTest, NothingTakesThePlaceOfADeviceAPipeOrAFolder) {
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  fs::create_symlink("/dev/null", folder_ / "null");
  for (const fs::path& file : {fs::path("/dev/null"), folder_ / "null", folder_ / "pipe", folder_}) {
    EXPECT_THAT(ErrorOf([&] { ReplacedFile made(file); }),
                AllOf(HasSubstr(file.string()), HasSubstr("give the name of a file")));
  }
  CheckWritable("/dev/null", Needs::kBytes);
  EXPECT_THAT(ErrorOf([] { CheckWritable("/dev/null", Needs::kFile); }), HasSubstr("a device"));
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  EXPECT_EQ(Entries(folder_), 2);
}

TEST_F(ReplacedFileTest, StreamsGetTheBytesThemselves) {
  ASSERT_EQ(mkfifo(file_.c_str(), 0600), 0);
  auto read = std::async(std::launch::async, [this] { return BytesOf(file_); });
  WriteFile(file_, "through a pipe");
  EXPECT_EQ(read.get(), "through a pipe");
  EXPECT_TRUE(fs::is_fifo(file_));
  EXPECT_THAT(ErrorOf([] { WriteFile("/dev/full", "x"); }), HasSubstr("No space left on device"));
  // A redirection: what was printed before stays, and the file is the one that is open.
  const fs::path redirected = folder_ / "redirected";
  const int descriptor = open(redirected.c_str(), O_WRONLY | O_CREAT, 0600);
  ASSERT_EQ(write(descriptor, "before ", 7), 7);
  WriteFile("/dev/fd/" + std::to_string(descriptor), "after ");
  WriteFile("/proc/self/fd/" + std::to_string(descriptor), "last");
  close(descriptor);
  EXPECT_EQ(BytesOf(redirected), "before after last");
  EXPECT_EQ(Entries(folder_), 2);
}

TEST_F(ReplacedFileTest, WhatCantBeWrittenLeavesTheOldOneAndNothingBeside) {
  WriteFile(file_, "old");
  {
    const tutti::testing::FullDisk full(10);
    EXPECT_THAT(ErrorOf([&] { WriteFile(file_, std::string(100, 'x')); }),
                AllOf(HasSubstr(file_.string()), HasSubstr("File too large")));
  }
  {
    const ReplacedFile never_complete(file_);
    EXPECT_EQ(Entries(folder_), 2);
  }
  EXPECT_EQ(BytesOf(file_), "old");
  EXPECT_EQ(Entries(folder_), 1);
  EXPECT_THAT(ErrorOf([&] { WriteFile(folder_ / "no" / "file", "x"); }),
              HasSubstr("No such file or directory"));
  EXPECT_THAT(ErrorOf([&] { CheckWritable(folder_ / "no" / "file", Needs::kBytes); }),
              HasSubstr("No such file or directory"));
}

// In a folder where others may write, too.
TEST_F(ReplacedFileTest, ALinkThatWaitsAtTheNameBesideIsNotFollowed) {
  const fs::path other = folder_ / "other";
  WriteFile(other, "of another one");
  const std::string start = (folder_ / PartPrefix(file_)).string() + std::to_string(getpid()) + "-";
  for (int k = 0; k < 100; ++k) fs::create_symlink(other, start + std::to_string(k));
  WriteFile(file_, "mine");
  EXPECT_EQ(BytesOf(other), "of another one");
  EXPECT_EQ(BytesOf(file_), "mine");
  EXPECT_FALSE(fs::is_symlink(file_));
}

}  // namespace
}  // namespace tutti::internal
