#include "loopclosure/detector/journal.h"

#include <gtest/gtest.h>

#include "core/state_archive.h"
#include "tests/loopclosure/detector/shown_state.h"
#include "tests/support/test_data.h"

namespace tutti::internal {
namespace {

using Kind = LocationStore::Kind;
using tutti::testing::OneMember;
using tutti::testing::RefusalOf;
using tutti::testing::Show;

class JournalTest : public ::testing::Test {
 protected:
  // Shows the image and notes it.
  void ShowAndNote(int i) {
    Show(state_, i, i + 1);
    journal_.Note();
  }
  // What opening the store again makes of it.
  std::string Reopened(std::int64_t* last_id = nullptr) {
    DetectorState state(OneMember());
    Journal journal(state);
    std::string refusal = RefusalOf([&] { journal.Reopen(store_); });
    if (last_id != nullptr) *last_id = state.last_id();
    return refusal;
  }

  LocationStore store_{(tutti::testing::FreshFolder() / "places.ltm").string()};
  DetectorState state_{OneMember()};
  Journal journal_{state_};
};

TEST_F(JournalTest, AReopenedDetectorKnowsWhatWasWritten) {
  journal_.Reopen(store_);  // new: marks it as ours
  for (int i = 0; i < 5; ++i) {
    ShowAndNote(i);
    EXPECT_FALSE(journal_.Holds(i));
    journal_.Write(store_);
    EXPECT_TRUE(journal_.Holds(i));
  }
  DetectorState again(OneMember());
  Journal journal(again);
  journal.Reopen(store_);
  EXPECT_EQ(again.last_id(), 4);
  EXPECT_EQ(StateBytes(again), StateBytes(state_));
  EXPECT_EQ(again.memory().working_memory(), state_.memory().working_memory());
  EXPECT_EQ(again.members()[0].num_words(), state_.members()[0].num_words());
  for (int slot = 0; slot < 5; ++slot) EXPECT_TRUE(again.HasView(slot));
  Show(again, 5, 6);  // and goes on
  journal.Note();
  EXPECT_NO_THROW(journal.Write(store_));
}

TEST_F(JournalTest, WhatAFullStoreRefusedIsWrittenWhenThereIsRoom) {
  journal_.Reopen(store_);
  ShowAndNote(0);
  journal_.Write(store_);
  store_.LimitPages(8);
  for (int i = 1; i < 3; ++i) {
    ShowAndNote(i);
    EXPECT_THROW(journal_.Write(store_), InputError);
    EXPECT_FALSE(journal_.Holds(i));
  }
  std::int64_t last_id = -1;
  EXPECT_EQ(Reopened(&last_id), "");
  EXPECT_EQ(last_id, 0);  // all of an image, or nothing
  store_.LimitPages(100000);
  ShowAndNote(3);
  journal_.Write(store_);
  EXPECT_EQ(Reopened(&last_id), "");
  EXPECT_EQ(last_id, 3);
}

TEST_F(JournalTest, ClearForgetsWhatNoStoreWantsToKnow) {
  ShowAndNote(0);
  journal_.Clear();
  EXPECT_TRUE(journal_.Holds(0));
  journal_.Write(store_);  // no location, nothing but the statistics
  EXPECT_EQ(store_.Get(Kind::kView, 0, 0), std::nullopt);
}

TEST_F(JournalTest, RewriteReplacesWhatIsThereAndTakesLongTermMemoryAlong) {
  ShowAndNote(0);
  ShowAndNote(1);
  journal_.Clear();
  store_.Put(Kind::kView, 0, 99, "of another detector");
  LocationStore long_term("");
  long_term.Put(Kind::kView, 0, 50, "left memory");
  journal_.Rewrite(store_, &long_term);
  EXPECT_EQ(store_.Get(Kind::kView, 0, 99), std::nullopt);
  EXPECT_EQ(store_.Get(Kind::kView, 0, 50), "left memory");
  std::int64_t last_id = -1;
  EXPECT_EQ(Reopened(&last_id), "");
  EXPECT_EQ(last_id, 1);
  store_.LimitPages(1);
  ShowAndNote(2);
  EXPECT_THROW(journal_.Rewrite(store_, nullptr), InputError);
  EXPECT_EQ(store_.Get(Kind::kView, 0, 50), "left memory");
}

TEST_F(JournalTest, AStoreOfAnotherConfigurationOrWithGapsIsRefused) {
  journal_.Reopen(store_);
  EXPECT_EQ(Reopened(), "");  // nothing was written yet
  for (int i = 0; i < 3; ++i) ShowAndNote(i);
  journal_.Write(store_);
  LoopDetectorOptions options = OneMember();
  options.members = {"sift"};
  DetectorState other(options);
  EXPECT_NE(RefusalOf([&] { Journal(other).Reopen(store_); }).find("another configuration"),
            std::string::npos);
  const std::string statistics = *store_.Get(Kind::kMeta, 1, 0);
  std::string later = statistics;
  later[0] = 77;  // last id
  store_.Put(Kind::kMeta, 1, 0, later);
  EXPECT_NE(Reopened().find("the last location is missing"), std::string::npos);
  store_.Put(Kind::kMeta, 1, 0, statistics.substr(0, 9));
  EXPECT_NE(Reopened(), "");
  store_.Put(Kind::kMeta, 1, 0, statistics);
  EXPECT_EQ(Reopened(), "");
  for (const Kind kind : {Kind::kView, Kind::kSignature, Kind::kNode}) {
    const std::string whole = *store_.Get(kind, 0, 1);
    store_.Put(kind, 0, 1, whole.substr(0, whole.size() / 2));
    EXPECT_NE(Reopened().find("damaged"), std::string::npos) << static_cast<int>(kind);
    store_.Put(kind, 0, 1, whole);
  }
}

}  // namespace
}  // namespace tutti::internal
