#include "tests/support/made_once.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <stdexcept>
#include <string>

#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

class MadeOnceTest : public ::testing::Test {
 protected:
  MadeOnceTest() { Maker("one"); }
  void Maker(const std::string& contents) const { std::ofstream(maker_) << contents; }
  fs::path Make() {
    return testing::MadeOnce(name_, maker_, [this](const fs::path& folder) {
      EXPECT_FALSE(fs::exists(folder)) << "something of an earlier time is there";
      fs::create_directories(folder);
      if (fails_) throw std::runtime_error("half made");
      std::ofstream(folder / "number") << ++made_;
    });
  }

  const fs::path maker_ = testing::FreshFolder() / "maker";
  const std::string name_ = "made-once-test-" + std::to_string(getpid());
  int made_ = 0;
  bool fails_ = false;
};

TEST_F(MadeOnceTest, IsMadeTheFirstTimeAndAgainOnlyForAnotherMaker) {
  const fs::path folder = Make();
  EXPECT_EQ(Make(), folder);
  EXPECT_EQ(made_, 1);
  Maker("two");
  EXPECT_EQ(Make(), folder);
  EXPECT_EQ(made_, 2);
  EXPECT_EQ(Make(), folder);
  EXPECT_EQ(made_, 2);
  fs::remove_all(folder.parent_path());
  fs::remove(folder.parent_path().string() + ".lock");
}

TEST_F(MadeOnceTest, WhatIsHalfMadeIsMadeAnew) {
  fails_ = true;
  EXPECT_THROW(Make(), std::runtime_error);
  fails_ = false;
  const fs::path folder = Make();
  EXPECT_EQ(made_, 1);
  EXPECT_TRUE(fs::exists(folder / "number"));
  fs::remove_all(folder.parent_path());
  fs::remove(folder.parent_path().string() + ".lock");
}

TEST(DigestOf, TellsTextsApart) {
  EXPECT_EQ(testing::DigestOf("a"), "af63dc4c8601ec8c");  // FNV-1a's own example
  EXPECT_NE(testing::DigestOf("width 320"), testing::DigestOf("width 321"));
}

}  // namespace
}  // namespace tutti
