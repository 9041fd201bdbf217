#include "tutti/loopclosure/location_memory.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

using State = LocationMemory::State;
using LinkType = LocationMemory::LinkType;

TEST(LocationMemory, OldestLocationsLeaveShortTermMemoryFirst) {
  LocationMemory memory(3);
  for (int i = 0; i < 5; ++i) {
    memory.Add(100 + i);
    memory.Settle();
  }
  EXPECT_EQ(memory.working_memory(), (std::vector<int>{0, 1}));
  EXPECT_EQ(memory.state(1), State::kWorking);
  EXPECT_EQ(memory.state(2), State::kShortTerm);
  EXPECT_EQ(memory.Find(103), 3);
  EXPECT_EQ(memory.Find(7), -1);
}

TEST(LocationMemory, NeighboursCountOdometryLinksButNotLoopLinks) {
  LocationMemory memory(1);
  for (int i = 0; i < 12; ++i) memory.Add(i);
  memory.Settle();
  memory.AddLink(2, 8, LinkType::kLoop);
  const auto near = memory.Neighbours(2, 1);
  const std::vector<std::pair<int, int>> expected = {{2, 0}, {8, 0}, {1, 1}, {3, 1}, {7, 1}, {9, 1}};
  EXPECT_EQ(near, expected);
}

TEST(LocationMemory, ShortTermMemoryIsNoNeighbour) {
  LocationMemory memory(2);
  for (int i = 0; i < 5; ++i) memory.Add(i);
  memory.Settle();
  for (const auto& [slot, level] : memory.Neighbours(2, 5)) EXPECT_LE(slot, 2);
  EXPECT_TRUE(memory.Neighbours(4, 5).empty());
}

TEST(LocationMemory, RehearsalDropsTheNewerAndKeepsItsWeightAndName) {
  LocationMemory memory(5);
  memory.Add(10);
  memory.Add(11);
  memory.Add(12);
  EXPECT_EQ(memory.DropNewest(), 1);
  EXPECT_EQ(memory.weight(1), 1);
  EXPECT_EQ(memory.state(2), State::kMerged);
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
  EXPECT_EQ(memory.state(0), State::kShortTerm);
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

}  // namespace
}  // namespace tutti
