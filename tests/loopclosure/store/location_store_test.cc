#include "loopclosure/store/location_store.h"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <fstream>

#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

using Kind = LocationStore::Kind;
namespace fs = std::filesystem;

class LocationStoreTest : public ::testing::Test {
 protected:
  std::string File() const { return (folder_ / "ltm.sqlite").string(); }
  fs::path folder_ = tutti::testing::FreshFolder();
};

TEST_F(LocationStoreTest, ReturnsWhatWasPutAndNothingElse) {
  LocationStore store("");
  EXPECT_FALSE(store.durable());
  store.Put(Kind::kWord, 1, 7, std::string("a\0b", 3));
  store.Put(Kind::kWord, 1, 7, std::string("c\0d", 3));
  store.Put(Kind::kView, 1, 7, "");
  EXPECT_EQ(store.Get(Kind::kWord, 1, 7), std::string("c\0d", 3));
  EXPECT_EQ(store.Get(Kind::kView, 1, 7), std::string());
  EXPECT_EQ(store.Get(Kind::kWord, 7, 1), std::nullopt);
}

TEST_F(LocationStoreTest, WhatIsCommittedOutlivesTheObjectAndWhatIsNotIsGone) {
  {
    LocationStore store(File());
    EXPECT_TRUE(store.durable());
    store.Begin();
    store.Put(Kind::kView, 0, 1, "kept");
    store.Commit();
    store.Begin();
    store.Put(Kind::kView, 0, 2, "lost");
    store.Rollback();
    store.Rollback();  // nothing to take back: no harm
    store.Begin();
    store.Put(Kind::kView, 0, 3, "not committed");
  }
  LocationStore store(File());
  EXPECT_EQ(store.Get(Kind::kView, 0, 1), "kept");
  EXPECT_EQ(store.Get(Kind::kView, 0, 2), std::nullopt);
  EXPECT_EQ(store.Get(Kind::kView, 0, 3), std::nullopt);
}

TEST_F(LocationStoreTest, RecordsComeInAscendingOrder) {
  LocationStore store("");
  for (const int b : {5, 1, 3}) store.Put(Kind::kNode, 0, b, std::to_string(b));
  store.Put(Kind::kWord, 0, 2, "of another kind");
  std::string order;
  store.ForEach(Kind::kNode, [&](std::int64_t, std::int64_t, std::string_view bytes) { order += bytes; });
  EXPECT_EQ(order, "135");
  store.Clear();
  EXPECT_EQ(store.Get(Kind::kNode, 0, 1), std::nullopt);
}

// The message that opening the file fails with.
std::string Refusal(const std::string& file) {
  try {
    LocationStore store(file);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST_F(LocationStoreTest, ASecondProcessIsToldThatTheFileIsInUse) {
  const LocationStore first(File());
  EXPECT_NE(Refusal(File()).find(File() + ": is in use by another process"), std::string::npos);
}

TEST_F(LocationStoreTest, FilesThatAreNoStoreAreRefusedAndLeftAlone) {
  std::ofstream(File()) << std::string(5000, 'x');
  EXPECT_NE(Refusal(File()).find("is no long-term memory"), std::string::npos);
  EXPECT_EQ(fs::file_size(File()), 5000u);
  EXPECT_NE(Refusal((folder_ / "no" / "such" / "folder").string()).find("can't be written"),
            std::string::npos);
}

// A name that was given by mistake, or by a stranger's file.
TEST_F(LocationStoreTest, ADatabaseOfAnotherProgramStaysAsItIs) {
  const auto bytes = [this] {
    std::ifstream in(File(), std::ios::binary);
    return std::string((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  };
  for (const char* content : {"CREATE TABLE records (name TEXT)", "CREATE VIEW v AS SELECT 1",
                              "CREATE TABLE t (a); DROP TABLE t; PRAGMA application_id = 7",
                              "PRAGMA application_id = 7; CREATE TABLE t (a)"}) {
    fs::remove(File());
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(File().c_str(), &database), SQLITE_OK);
    ASSERT_EQ(sqlite3_exec(database, content, nullptr, nullptr, nullptr), SQLITE_OK);
    sqlite3_close(database);
    const std::string before = bytes();
    EXPECT_NE(Refusal(File()).find("is a database of another program"), std::string::npos) << content;
    EXPECT_EQ(bytes() == before, true) << content;
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1) << content;
  }
}

TEST_F(LocationStoreTest, AnEmptyFileBecomesAMemoryAndAFolderOrADeviceDoesNot) {
  std::ofstream(File()).flush();
  EXPECT_EQ(Refusal(File()), "");
  EXPECT_NE(Refusal(folder_.string()).find("is no file"), std::string::npos);
  EXPECT_NE(Refusal("/dev/null").find("is no file"), std::string::npos);
}

TEST_F(LocationStoreTest, DamageIsFoundByTheChecksum) {
  const std::string text(3000, 'q');
  {
    LocationStore store(File());
    store.Put(Kind::kView, 0, 1, text);
  }
  std::fstream file(File(), std::ios::in | std::ios::out | std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const std::size_t at = bytes.find(text);
  ASSERT_NE(at, std::string::npos);
  file.seekp(static_cast<std::streamoff>(at + 100));
  file.put('r');
  file.close();
  LocationStore store(File());
  EXPECT_THROW(store.Get(Kind::kView, 0, 1), InputError);
}

TEST_F(LocationStoreTest, AFullDiskIsSaidAndWhatWasStoredIsSafe) {
  {
    LocationStore store(File());
    store.Put(Kind::kView, 0, 1, "kept");
    store.LimitPages(20);
    store.Begin();
    try {
      for (int i = 2; i < 100; ++i) store.Put(Kind::kView, 0, i, std::string(4000, 'x'));
      FAIL() << "100 records of 4000 bytes went into 20 pages";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("the disk is full"), std::string::npos);
    }
    store.Rollback();
    store.Begin();  // and it goes on
    store.Put(Kind::kView, 0, 2, "small");
    store.Commit();
  }
  LocationStore store(File());
  EXPECT_EQ(store.Get(Kind::kView, 0, 1), "kept");
  EXPECT_EQ(store.Get(Kind::kView, 0, 2), "small");
}

}  // namespace
}  // namespace tutti::internal
