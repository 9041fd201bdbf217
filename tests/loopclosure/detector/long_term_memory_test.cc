#include "loopclosure/detector/long_term_memory.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "core/state_archive.h"
#include "tests/loopclosure/detector/shown_state.h"
#include "tests/support/test_data.h"

namespace tutti::internal {
namespace {

using Kind = LocationStore::Kind;
using tutti::testing::OneMember;
using tutti::testing::RefusalOf;
using tutti::testing::Show;

LoopDetectorOptions AtMostTwo() {
  LoopDetectorOptions options = OneMember();
  options.wm_limit = 2;
  options.recent_share = 0;
  return options;
}

// A detector's state with its long-term memory.
struct Remembering {
  explicit Remembering(const LoopDetectorOptions& options) : state(options), long_term(state) {}
  // Shows an image, and lets go what is too much.
  LoopResult Go(int i) {
    LoopResult result;
    Show(state, i, i + 1);
    long_term.Shrink(-1, 0, result);
    long_term.Record(result);
    return result;
  }
  std::string AllWarnings(int begin, int end) {
    std::string warnings;
    for (int i = begin; i < end; ++i) warnings += Go(i).warning;
    return warnings;
  }
  DetectorState state;
  LongTermMemory long_term;
};

TEST(LongTermMemory, WhatIsTooMuchLeavesAndComesBackNearTheHypothesis) {
  Remembering r(AtMostTwo());
  EXPECT_FALSE(r.long_term.has_store());
  EXPECT_EQ(r.AllWarnings(0, 6), "");
  EXPECT_TRUE(r.long_term.has_store());
  EXPECT_EQ(r.state.memory().working_memory().size(), 2u);
  EXPECT_EQ(r.state.memory().num_long_term(), 3);
  EXPECT_FALSE(r.state.HasView(0));
  LoopResult result;
  r.long_term.Retrieve(-1, result);  // no hypothesis
  EXPECT_TRUE(result.retrieved.empty());
  r.long_term.Retrieve(3, result);
  ASSERT_FALSE(result.retrieved.empty());
  for (const std::int64_t id : result.retrieved) {
    EXPECT_TRUE(r.state.HasView(static_cast<int>(id)));
    EXPECT_EQ(r.state.memory().state(static_cast<int>(id)), LocationState::kWorking);
  }
  EXPECT_EQ(result.warning, "");
}

TEST(LongTermMemory, OverTheTimeBudgetMoreGoesThanComes) {
  LoopDetectorOptions options = AtMostTwo();
  options.wm_limit = 0;
  options.time_budget_ms = 10;
  Remembering r(options);
  r.AllWarnings(0, 6);
  LoopResult result;
  r.long_term.Shrink(-1, 9, result);
  EXPECT_TRUE(result.transferred.empty());
  r.long_term.Shrink(-1, 11, result);
  EXPECT_EQ(result.transferred.size(), 2u);
}

TEST(LongTermMemory, WhatAFullStoreCannotTakeStaysAndIsAWarning) {
  Remembering r(AtMostTwo());
  r.long_term.store().LimitPages(2);
  EXPECT_NE(r.AllWarnings(0, 6).find("the disk is full"), std::string::npos);
  EXPECT_EQ(r.state.memory().num_long_term(), 0);
  for (int slot = 0; slot < 6; ++slot) EXPECT_TRUE(r.state.HasView(slot));
  r.long_term.store().LimitPages(100000);
  EXPECT_EQ(r.Go(6).warning, "");
  EXPECT_EQ(r.state.memory().working_memory().size(), 2u);
}

TEST(LongTermMemory, DamagedRecordsAreAWarningAndNothingElse) {
  Remembering r(AtMostTwo());
  r.AllWarnings(0, 6);
  const auto store = [&r]() -> LocationStore& { return r.long_term.store(); };
  const std::string signature = *store().Get(Kind::kSignature, 0, 2);
  store().Put(Kind::kSignature, 0, 2, "nonsense");
  store().Put(Kind::kView, 0, 1, "nonsense");
  LoopResult result;
  r.long_term.Retrieve(3, result);
  EXPECT_NE(result.warning.find("damaged"), std::string::npos);
  EXPECT_EQ(r.state.memory().state(2), LocationState::kLongTerm);  // its words are lost: it stays
  EXPECT_EQ(r.state.memory().state(1), LocationState::kWorking);   // only its features are
  EXPECT_TRUE(r.state.view(1).members.front().pixels.empty());
  store().Put(Kind::kSignature, 0, 2, signature);
  LoopResult again;
  r.long_term.Retrieve(3, again);
  EXPECT_EQ(r.state.memory().state(2), LocationState::kWorking);
}

class LongTermFile : public ::testing::Test {
 protected:
  LoopDetectorOptions InFile() const {
    LoopDetectorOptions options = AtMostTwo();
    options.ltm_file = (folder_ / "places.ltm").string();
    return options;
  }
  std::filesystem::path folder_ = tutti::testing::FreshFolder();
};

TEST_F(LongTermFile, ItsFileIsOpenedAgain) {
  {
    Remembering r(InFile());
    EXPECT_FALSE(r.long_term.has_store());  // opens nothing by itself
    r.long_term.Open();
    EXPECT_EQ(r.AllWarnings(0, 6), "");
    Remembering second(InFile());
    EXPECT_NE(RefusalOf([&] { second.long_term.Open(); }).find("in use"), std::string::npos);
  }
  Remembering again(InFile());
  again.long_term.Open();
  EXPECT_EQ(again.state.last_id(), 5);
  EXPECT_EQ(again.state.memory().num_long_term(), 3);
}

TEST_F(LongTermFile, NothingLeavesBeforeItIsInTheFile) {
  Remembering r(InFile());
  r.long_term.Open();
  r.Go(0);
  r.long_term.store().LimitPages(8);
  EXPECT_NE(r.AllWarnings(1, 6).find("still in memory"), std::string::npos);
  EXPECT_EQ(r.state.memory().num_long_term(), 1);
  EXPECT_NE(r.long_term.store().Get(Kind::kView, 0, 0), std::nullopt);
}

TEST_F(LongTermFile, AnotherMemoryTakesTheFileOverOrLeavesItAsItWas) {
  Remembering owner(InFile());
  owner.long_term.Open();
  owner.AllWarnings(0, 2);
  Remembering next(AtMostTwo());
  next.AllWarnings(0, 6);
  owner.long_term.store().LimitPages(1);
  EXPECT_THROW(next.long_term.TakeFile(owner.long_term), InputError);
  EXPECT_TRUE(owner.long_term.store().durable());
  EXPECT_FALSE(next.long_term.store().durable());
  owner.long_term.store().LimitPages(100000);
  next.long_term.TakeFile(owner.long_term);
  EXPECT_TRUE(next.long_term.store().durable());
  EXPECT_EQ(next.Go(6).warning, "");
  LoopResult result;
  next.long_term.Retrieve(4, result);
  EXPECT_FALSE(result.retrieved.empty());
  Remembering without_file(AtMostTwo());
  next.long_term.TakeFile(without_file.long_term);  // has none: nothing happens
  EXPECT_TRUE(next.long_term.store().durable());
}

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
