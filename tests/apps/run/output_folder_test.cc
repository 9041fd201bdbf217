// The folder that results go into: whose it is, and what happens to an earlier result.
#include "apps/run/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <new>
#include <utility>

#include "core/replaced_file.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::WriteAll;

bool IsResult(const fs::path& entry) {
  const std::string name = entry.filename();
  return name == "a" || name == "b" || name == "c" || name == "last";
}

const OutputLayout kLayout = {IsResult, "last", "version", {"live"}, nullptr};

OutputFile File(const std::string& name, const std::string& text) {
  return {name, [text](const fs::path& file) { internal::WriteFile(file, text); }};
}

class OutputFolderTest : public ::testing::Test {
 protected:
  fs::path WriteResult(const std::vector<std::string>& names, const std::string& text, bool keep = false,
                       bool whole = true) {
    OutputFolder folder(out_, kLayout, keep);
    WriteAll(out_ / "live", "so far");
    for (const std::string& name : names) folder.Write(File(name, text));
    return folder.Finish(whole);
  }
  void ExpectRefused(const std::string& what) {
    EXPECT_THAT(testing::ErrorOf([&] { const OutputFolder folder(out_, kLayout); }),
                AllOf(HasSubstr(out_.string()), HasSubstr(what)));
  }
  std::string Text(const fs::path& name) const { return ReadAll(out_ / name); }

  const fs::path out_ = testing::FreshFolder() / "out";
};

TEST_F(OutputFolderTest, TheEarlierResultStaysUntilTheNewOneIsComplete) {
  WriteResult({"a", "b", "last"}, "old");
  EXPECT_FALSE(fs::exists(out_ / "live"));
  OutputFolder(out_, kLayout).Write(File("a", "new"));  // and no Finish
  EXPECT_EQ(Text("a") + Text("last"), "oldold");
  {
    OutputFolder folder(out_, kLayout);
    folder.Write(File("a", "new"));
    folder.Write(File("last", "new"));
    EXPECT_EQ(Text("a") + Text("b") + Text("last"), "oldoldold");
    EXPECT_EQ(folder.Finish(true), out_);
  }
  EXPECT_EQ(Text("a") + Text("last"), "newnew");
  EXPECT_FALSE(fs::exists(out_ / "b"));  // the new result has none
  EXPECT_FALSE(fs::exists(out_ / ".tutti-new"));
}

TEST_F(OutputFolderTest, WhatIsNotWholeGoesBesideACompleteResultAndElseIntoItsPlace) {
  EXPECT_EQ(WriteResult({"a"}, "first", false, false), out_);  // there is no earlier one
  EXPECT_EQ(Text("a"), "first");
  WriteResult({"a", "last"}, "old");
  EXPECT_EQ(WriteResult({"a", "last"}, "new", false, false), out_ / "unfinished");
  EXPECT_EQ(Text("a") + Text("unfinished/a"), "oldnew");
  WriteResult({"a", "last"}, "newer");
  EXPECT_EQ(Text("a"), "newer");
  EXPECT_FALSE(fs::exists(out_ / "unfinished"));
}

TEST_F(OutputFolderTest, AFileThatFailsIsNamedWithTheReasonAndStopsNoOther) {
  WriteResult({"a", "b", "c", "last"}, "old");
  OutputFolder folder(out_, kLayout);
  WriteAll(out_ / "live", "so far");
  folder.Write({"a", [](const fs::path& file) {
                  fs::create_symlink("/dev/full", file);
                  internal::WriteFile(file, "new");
                }});
  folder.Write({"b", [](const fs::path&) { throw std::bad_alloc(); }});
  folder.Write(File("c", "new"));
  folder.Write(File("last", "new"));
  EXPECT_THAT(folder.failures(), ElementsAre((out_ / "a").string() + ": No space left on device",
                                             (out_ / "b").string() + ": " + std::bad_alloc().what()));
  EXPECT_EQ(folder.Finish(true), out_ / "unfinished");
  EXPECT_EQ(Text("a") + Text("c"), "oldold");
  EXPECT_EQ(Text("unfinished/c"), "new");
  EXPECT_FALSE(fs::exists(out_ / "unfinished" / "a"));
  EXPECT_EQ(Text("live"), "so far");  // there is nothing better
}

// A folder that came from elsewhere may hold anything.
TEST_F(OutputFolderTest, NothingIsWrittenBehindALink) {
  const fs::path other = out_.parent_path() / "other";
  fs::create_directories(other);
  WriteAll(other / "file", "of another one");
  using Link = std::pair<const char*, fs::path>;
  for (const auto& [name, target] :
       {Link("live", other / "file"), Link(".tutti-lock", other / "file"), Link(".tutti-new", other),
        Link(".tutti-enter", other), Link(".tutti-write-test", other / "file"), Link("1", other),
        Link("unfinished", other)}) {
    fs::remove_all(out_);
    WriteResult({"a", "last"}, "old");
    fs::remove(out_ / name);
    fs::create_symlink(target, out_ / name);
    EXPECT_THAT(testing::ErrorOf([&] { OutputFolder refused(out_, kLayout); }),
                AllOf(HasSubstr((out_ / name).string()), HasSubstr("is a link")))
        << name;
    EXPECT_EQ(Text("a"), "old");
  }
  EXPECT_EQ(ReadAll(other / "file"), "of another one");
  EXPECT_EQ(std::distance(fs::directory_iterator(other), fs::directory_iterator()), 1);
  fs::remove_all(out_);
  WriteResult({"a", "last"}, "old");
  fs::create_directory(out_ / ".tutti-complete-..");  // would send the result into the folder above
  { OutputFolder again(out_, kLayout); }
  EXPECT_EQ(Text("a"), "old");
}

TEST_F(OutputFolderTest, KeepNumbersEarlierResults) {
  for (const char* text : {"first", "second", "third"}) WriteResult({"a", "last"}, text, true);
  EXPECT_EQ(Text("1/a") + Text("1/last"), "firstfirst");
  EXPECT_EQ(Text("2/a"), "second");
  EXPECT_EQ(Text("a"), "third");
  WriteResult({"a", "last"}, "unwhole", true, false);
  WriteAll(out_ / "live", "of a run that was killed");
  WriteResult({"a", "last"}, "last one", true);
  EXPECT_EQ(Text("3/a"), "unwhole");
  EXPECT_EQ(Text("4/live"), "of a run that was killed");
  EXPECT_EQ(Text("5/a"), "third");
  EXPECT_EQ(Text("a"), "last one");
}

TEST_F(OutputFolderTest, KilledWhileItWritesItLeavesTheEarlierResult) {
  WriteResult({"a", "b", "last"}, "old");
  const pid_t child = fork();
  if (child == 0) {
    OutputFolder folder(out_, kLayout);
    folder.Write(File("a", "new"));
    folder.Write({"b", [](const fs::path& file) {
                    internal::WriteFile(file, "half");
                    raise(SIGKILL);
                  }});
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(Text("a") + Text("b") + Text("last"), "oldoldold");
  WriteResult({"a", "last"}, "newer");  // what is left over is in nobody's way
  EXPECT_EQ(Text("a") + Text("last"), "newernewer");
}

TEST_F(OutputFolderTest, KilledBetweenTheFirstAndTheLastMoveTheNextRunMovesTheRest) {
  WriteResult({"a", "b", "last"}, "old");
  fs::create_directories(out_ / ".tutti-complete");  // all is written, nothing moved
  for (const char* name : {"a", "c", "last"}) WriteAll(out_ / ".tutti-complete" / name, "new");
  { const OutputFolder folder(out_, kLayout); }
  EXPECT_EQ(Text("a") + Text("c") + Text("last"), "newnewnew");
  EXPECT_FALSE(fs::exists(out_ / "b"));

  fs::create_directories(out_ / ".tutti-enter");  // "c" has been moved
  for (const char* name : {"a", "last"}) WriteAll(out_ / ".tutti-enter" / name, "newer");
  WriteAll(out_ / "c", "newer");
  { const OutputFolder folder(out_, kLayout); }
  EXPECT_EQ(Text("a") + Text("c") + Text("last"), "newernewernewer");

  fs::create_directories(out_ / ".tutti-complete-1");  // with --keep; "a" has been moved to its number
  WriteAll(out_ / ".tutti-complete-1" / "last", "newest");
  fs::create_directories(out_ / "1");
  fs::rename(out_ / "a", out_ / "1" / "a");
  { const OutputFolder folder(out_, kLayout); }
  EXPECT_EQ(Text("1/a") + Text("1/c") + Text("1/last"), "newernewernewer");
  EXPECT_EQ(Text("last"), "newest");
}

TEST_F(OutputFolderTest, ForeignFilesAreRefusedAndNothingChanges) {
  fs::create_directories(out_ / "images");
  ExpectRefused("images");
  EXPECT_FALSE(fs::exists(out_ / ".tutti-lock"));
  fs::remove(out_ / "images");
  WriteAll(out_ / "a", "a reference that has the name of a result");
  ExpectRefused("no last");
  WriteAll(out_ / "last", "{\"other\": 1}");
  ExpectRefused("no last");
  WriteAll(out_ / "last", "{\"version\": \"0.1\"}");  // of a tutti before folders were marked
  const OutputFolder folder(out_, kLayout);
}

TEST_F(OutputFolderTest, AForeignFileBesideAnEarlierResultIsRefused) {
  WriteResult({"a", "last"}, "old");
  WriteAll(out_ / "groundtruth.txt", "0 0 0 0 0 0 0 1\n");
  ExpectRefused("groundtruth.txt");
  WriteAll(out_ / ".hidden", "of a file manager");
  const OutputFolder folder(out_, kLayout, false, out_ / "groundtruth.txt");  // it is the command's own
}

TEST_F(OutputFolderTest, PartsAreResultsOfTheirOwnAndStay) {
  const OutputLayout layout = {
      IsResult, "last", "version", {}, [](const fs::path& entry) { return fs::exists(entry / "run_1"); }};
  fs::create_directories(out_ / "orb" / "run_1");  // left by a process that was killed
  for (int i = 0; i < 2; ++i) {
    OutputFolder folder(out_, layout);
    folder.Write(File("last", "new"));
    folder.Finish(true);
  }
  EXPECT_TRUE(fs::exists(out_ / "orb" / "run_1"));
  ExpectRefused("orb");  // by a command that has no parts
}

TEST_F(OutputFolderTest, WhatTheRunReadsIsNotInside) {
  fs::create_directories(out_);
  WriteAll(out_ / "a", "reference");
  EXPECT_THROW(RefuseToReplace(out_, out_ / "a"), InputError);
  EXPECT_THROW(RefuseToReplace(out_, out_ / ".." / "out" / "a"), InputError);
  EXPECT_NO_THROW(RefuseToReplace(out_, out_.parent_path() / "out2" / "a"));
}

TEST_F(OutputFolderTest, TwoAtOnceAreRefusedWithTheFirstOnesProcess) {
  {
    const OutputFolder first(out_, kLayout);
    ExpectRefused("process " + std::to_string(getpid()));
  }
  const OutputFolder second(out_, kLayout);
}

}  // namespace
}  // namespace tutti
