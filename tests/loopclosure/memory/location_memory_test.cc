#include "loopclosure/memory/location_memory.h"

#include <gtest/gtest.h>

#include <limits>
#include <map>

#include "core/state_archive.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using LinkType = LocationMemory::LinkType;

TEST(LocationMemory, OldestLocationsLeaveShortTermMemoryFirst) {
  LocationMemory memory(3);
  for (int i = 0; i < 5; ++i) {
    memory.Add(100 + i);
    memory.Settle();
  }
  EXPECT_EQ(memory.working_memory(), (std::vector<int>{0, 1}));
  EXPECT_EQ(memory.state(1), LocationState::kWorking);
  EXPECT_EQ(memory.state(2), LocationState::kShortTerm);
  EXPECT_EQ(memory.Find(103), 3);
  EXPECT_EQ(memory.Find(7), -1);
}

TEST(LocationMemory, NeighboursCountOdometryLinksButNotLoopLinks) {
  LocationMemory memory(1);
  for (int i = 0; i < 12; ++i) memory.Add(i);
  memory.Settle();
  memory.AddLink(2, 8, LinkType::kLoop);
  const auto near = memory.Neighbours(2, 1);
  const std::vector<LocationMemory::Neighbour> expected = {{2, 0, 0}, {8, 0, 1}, {1, 1, 0},
                                                           {3, 1, 0}, {7, 1, 1}, {9, 1, 1}};
  EXPECT_EQ(near, expected);
}

TEST(LocationMemory, ShortTermMemoryIsNoNeighbour) {
  LocationMemory memory(2);
  for (int i = 0; i < 5; ++i) memory.Add(i);
  memory.Settle();
  for (const auto& [slot, level, loops] : memory.Neighbours(2, 5)) EXPECT_LE(slot, 2);
  EXPECT_TRUE(memory.Neighbours(4, 5).empty());
}

TEST(LocationMemory, RehearsalDropsTheNewerAndKeepsItsWeightAndName) {
  LocationMemory memory(5);
  memory.Add(10);
  memory.Add(11);
  memory.Add(12);
  EXPECT_EQ(memory.DropNewest(), 1);
  EXPECT_EQ(memory.weight(1), 1);
  EXPECT_EQ(memory.state(2), LocationState::kMerged);
  EXPECT_EQ(memory.Find(12), 1);
  memory.Add(13);
  ASSERT_EQ(memory.links(3).size(), 1u);
  EXPECT_EQ(memory.links(3)[0].slot, 1);
}

TEST(LocationMemory, NothingToRehearseInAnEmptyShortTermMemory) {
  LocationMemory memory(5);
  EXPECT_EQ(memory.DropNewest(), -1);
  memory.Add(1);
  EXPECT_EQ(memory.DropNewest(), -1);
  EXPECT_EQ(memory.state(0), LocationState::kShortTerm);
}

TEST(LocationMemory, ALoopHandsTheWeightOn) {
  LocationMemory memory(5);
  memory.Add(1);
  memory.Add(2);
  memory.DropNewest();
  memory.Add(3);
  memory.TransferWeight(2, 0);
  EXPECT_EQ(memory.weight(2), 1);
  EXPECT_EQ(memory.weight(0), 0);
}

TEST(LocationMemory, ALinkIsMadeOnce) {
  LocationMemory memory(5);
  memory.Add(1);
  memory.Add(2);
  EXPECT_FALSE(memory.AddLink(0, 1, LinkType::kOdometry));
  EXPECT_FALSE(memory.AddLink(1, 1, LinkType::kLoop));
}

// Ten locations in WM (0..9) and one in STM (10).
LocationMemory ShortChain() {
  LocationMemory memory(1);
  for (int i = 0; i < 11; ++i) {
    memory.Add(i);
    memory.Settle();
  }
  return memory;
}

TEST(LocationMemory, ALoopIsTakenBackAndOdometryStays) {
  LocationMemory memory(1);
  for (int i = 0; i < 12; ++i) memory.Add(i);
  memory.Settle();
  const auto before = memory.Neighbours(2, 1);
  ASSERT_TRUE(memory.AddLink(2, 8, LinkType::kLoop));
  EXPECT_GT(memory.Neighbours(2, 1).size(), before.size());
  EXPECT_TRUE(memory.RemoveLoop(8, 2));
  EXPECT_EQ(memory.Neighbours(2, 1), before);
  EXPECT_FALSE(memory.RemoveLoop(8, 2));  // there is none any more
  EXPECT_FALSE(memory.RemoveLoop(2, 3));  // neighbours in time
  EXPECT_EQ(memory.Neighbours(2, 1), before);
}

TEST(LocationMemory, TheLightestThenTheOldestIsTransferredFirst) {
  LocationMemory memory = ShortChain();
  EXPECT_EQ(memory.NextToTransfer(0.0, {}), 0);
  memory.AddLink(0, 4, LinkType::kLoop);
  EXPECT_EQ(memory.NextToTransfer(0.0, {0, 1}), 2);
  memory.Transfer(0);
  memory.Transfer(1);
  memory.Retrieve(0);  // entered WM after all others
  EXPECT_EQ(memory.NextToTransfer(0.0, {}), 2);
  EXPECT_EQ(memory.working_memory(), (std::vector<int>{0, 2, 3, 4, 5, 6, 7, 8, 9}));
}

TEST(LocationMemory, APlaceSeenOverAndOverKeepsAFewLoopLinksToWalk) {
  LocationMemory memory(1);
  for (int i = 0; i < 41; ++i) {
    memory.Add(i);
    memory.Settle();
  }
  for (int i = 4; i < 40; i += 4) {
    EXPECT_TRUE(memory.AddLink(i, 0, LinkType::kLoop));
    EXPECT_FALSE(memory.AddLink(i, 0, LinkType::kLoop));
  }
  EXPECT_EQ(memory.links(0).size(), 10u);  // all are known
  const auto same_place = memory.Neighbours(0, 0);
  EXPECT_EQ(same_place, (std::vector<LocationMemory::Neighbour>{
                            {0, 0, 0}, {4, 0, 1}, {8, 0, 1}, {12, 0, 1}, {16, 0, 1}}));
  EXPECT_EQ(memory.Neighbours(36, 0), (std::vector<LocationMemory::Neighbour>{{36, 0, 0}}));
}

TEST(LocationMemory, ANeighbourIsOneFromEitherEnd) {
  LocationMemory memory(1);
  for (int i = 0; i < 201; ++i) {
    memory.Add(i);
    memory.Settle();
  }
  for (unsigned i = 0; i < 300; ++i) {
    memory.AddLink(static_cast<int>(i * 7919u % 200u), static_cast<int>(i * 104729u % 197u), LinkType::kLoop);
  }
  std::map<std::pair<int, int>, int> levels;
  for (int a = 0; a < 200; ++a) {
    for (const auto& [b, level, loops] : memory.Neighbours(a, 3)) levels[{a, b}] = level;
  }
  for (const auto& [pair, level] : levels) {
    const auto back = levels.find({pair.second, pair.first});
    ASSERT_NE(back, levels.end());
    EXPECT_EQ(back->second, level);
  }
}

TEST(LocationMemory, WeightKeepsALocationAndRecentOnesAndThoseLinkedToShortTermMemoryStay) {
  LocationMemory memory(2);
  memory.Add(0);
  memory.Add(1);
  memory.DropNewest();  // location 0 has weight 1
  for (int i = 2; i < 7; ++i) {
    memory.Add(i);
    memory.Settle();
  }
  // WM: slots 0, 2, 3, 4; STM: 5, 6. Slot 4 is linked to 5.
  EXPECT_EQ(memory.NextToTransfer(0.0, {}), 2);
  EXPECT_EQ(memory.NextToTransfer(0.0, {2, 3}), 0);
  EXPECT_EQ(memory.NextToTransfer(0.0, {0, 2, 3}), -1);
  EXPECT_EQ(memory.NextToTransfer(0.75, {0}), -1);  // 2, 3 and 4 are the newest three quarters
}

TEST(LocationMemory, LongTermNeighboursAreFoundAcrossLongTermMemory) {
  LocationMemory memory = ShortChain();
  for (const int slot : {3, 4, 5}) EXPECT_TRUE(memory.Transfer(slot));
  EXPECT_FALSE(memory.Transfer(3));
  EXPECT_EQ(memory.state(4), LocationState::kLongTerm);
  EXPECT_EQ(memory.num_long_term(), 3);
  EXPECT_EQ(memory.LongTermNeighbours(2, 10, 2), (std::vector<int>{3, 4}));
  EXPECT_EQ(memory.LongTermNeighbours(7, 1, 2), std::vector<int>{});
  EXPECT_EQ(memory.LongTermNeighbours(7, 10, 9), (std::vector<int>{5, 4, 3}));
  // Neighbours for the filter do not reach through it.
  for (const auto& [slot, level, loops] : memory.Neighbours(2, 16)) EXPECT_LE(slot, 2);
  EXPECT_TRUE(memory.Retrieve(4));
  EXPECT_FALSE(memory.Retrieve(4));
  EXPECT_EQ(memory.num_long_term(), 2);
}

TEST(LocationMemory, AnIgnoredLocationLeavesNoWeight) {
  LocationMemory memory(5);
  memory.Add(10);
  EXPECT_EQ(memory.IgnoreNewest(), -1);
  memory.Add(11);
  EXPECT_EQ(memory.IgnoreNewest(), 0);
  EXPECT_EQ(memory.weight(0), 0);
  EXPECT_EQ(memory.Find(11), 0);
}

struct Record {
  std::int64_t id;
  LocationState state;
  int weight;
  std::int64_t entered;
  int names;
  std::vector<LocationMemory::Link> links = {};

  template <class Archive>
  void State(Archive& archive) {
    archive(id, state, weight, entered, names, links);
  }
};

int LoadedSize(const std::vector<Record>& records) {
  std::string bytes = internal::StateBytes(static_cast<int>(records.size()));
  for (const Record& record : records) bytes += internal::StateBytes(record);
  LocationMemory memory(2);
  internal::ReadStateBytes(bytes, "test", memory);
  return memory.size();
}

TEST(LocationMemory, WhatNoMemoryWouldHaveSavedIsRefused) {
  const std::vector<Record> good = {{10, LocationState::kWorking, 1, 0, 0},
                                    {11, LocationState::kMerged, 0, 0, 0},
                                    {12, LocationState::kShortTerm, 0, 0, 2}};
  EXPECT_EQ(LoadedSize(good), 3);
  const auto refused = [&](std::size_t i, const Record& record) {
    std::vector<Record> records = good;
    records[i] = record;
    EXPECT_THROW(LoadedSize(records), InputError) << "record " << i << ", id " << record.id;
  };
  refused(0, {-1, LocationState::kWorking, 1, 0, 0});                                // a negative id
  refused(0, {11, LocationState::kWorking, 1, 0, 0});                                // an id twice
  refused(0, {10, LocationState::kWorking, -1, 0, 0});                               // less than no weight
  refused(0, {10, LocationState::kWorking, std::numeric_limits<int>::max(), 0, 0});  // more than all weigh
  refused(0,
          {10, LocationState::kWorking, 1, std::numeric_limits<std::int64_t>::max(), 0});  // entries overflow
  refused(1, {11, LocationState::kMerged, 0, 0, 1});   // merged into itself
  refused(1, {11, LocationState::kWorking, 0, 0, 0});  // not merged, but another's
  refused(2, {12, LocationState::kMerged, 0, 0, 1});   // into a merged one
}

TEST(LocationMemory, AMergedLocationHandsLinksWeightAndNamesToAnOlderOne) {
  LocationMemory memory(2);
  for (int i = 0; i < 8; ++i) memory.Add(10 + i);
  memory.DropNewest();  // 17 names 16
  memory.Settle();      // 15 and 16 stay
  memory.AddLink(1, 4, LinkType::kLoop);
  EXPECT_FALSE(memory.CanMerge(1, 4)) << "only into an older one";
  EXPECT_FALSE(memory.CanMerge(6, 1)) << "the newest stays";
  ASSERT_TRUE(memory.CanMerge(4, 1));
  memory.Merge(4, 1);
  EXPECT_EQ(memory.state(4), LocationState::kMerged);
  EXPECT_EQ(memory.Find(14), 1);
  EXPECT_EQ(memory.weight(1), 1);
  const std::vector<LocationMemory::Neighbour> near = {{1, 0, 0}, {0, 1, 0}, {2, 1, 0}, {3, 1, 0}};
  EXPECT_EQ(memory.Neighbours(1, 1), near) << "3 was before it";
  ASSERT_TRUE(memory.CanMerge(1, 0));
  memory.Merge(1, 0);
  EXPECT_EQ(memory.Find(14), 0) << "what it had taken over goes along";
  EXPECT_EQ(memory.weight(0), 2);
  EXPECT_FALSE(memory.CanMerge(3, 1)) << "that is no longer there";
  memory.Merge(5, 0);  // of short-term memory
  EXPECT_EQ(memory.short_term_memory(), (std::deque<int>{6}));
  LocationMemory again(2);
  internal::ReadStateBytes(internal::StateBytes(memory), "it", again);
  EXPECT_EQ(again.Find(14), 0);
  EXPECT_EQ(again.working_memory(), (std::vector<int>{0, 2, 3}));
  EXPECT_EQ(again.short_term_memory(), (std::deque<int>{6}));
}

}  // namespace
}  // namespace tutti
