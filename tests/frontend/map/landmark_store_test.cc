#include "tutti/frontend/landmark.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

constexpr int kMany = 200;  // four chunks, of which the last one is not full

Landmark At(int x) {
  Landmark landmark;
  landmark.alive = true;
  landmark.position.x() = x;
  landmark.observations = {{x, 1}};
  return landmark;
}

LandmarkStore Many() {
  LandmarkStore store;
  for (int i = 0; i < kMany; ++i) store.Append(At(i));
  return store;
}

// All but each third.
LandmarkStore OneOfThreeLives() {
  LandmarkStore store = Many();
  for (int i = 0; i < kMany; ++i) store.Mutable(i).alive = i % 3 == 0;
  return store;
}

void ExpectOneOfThreeLives(const LandmarkStore& store) {
  for (int i = 0; i < kMany; ++i) {
    EXPECT_EQ(store[i].alive, i % 3 == 0) << i;
    if (i % 3 != 0) continue;
    EXPECT_EQ(store[i].position.x(), i);
    EXPECT_EQ(store[i].observations[0].keyframe, i);
  }
}

TEST(LandmarkStore, WhoLivesKeepsNumberAndContentsWhenTheDeadAreTakenAway) {
  LandmarkStore store = OneOfThreeLives();
  store.Compact();
  ASSERT_EQ(store.size(), kMany);
  ExpectOneOfThreeLives(store);
  EXPECT_TRUE(store[1].observations.empty());
  EXPECT_EQ(store[193].position.x(), 193) << "the last chunk still grows: it stays";
  EXPECT_EQ(&store[3], &store[0] + 1) << "no room between the living";
}

TEST(LandmarkStore, NumbersGoOnAfterThoseThatAreGone) {
  LandmarkStore store = OneOfThreeLives();
  store.Compact();
  store.Append(At(7));
  EXPECT_EQ(store.size(), kMany + 1);
  EXPECT_EQ(store[kMany].position.x(), 7);
  for (int i = 0; i < kMany; ++i) store.Mutable(i).alive = false;
  store.Compact();
  EXPECT_TRUE(store[kMany].alive);
  EXPECT_FALSE(store[0].alive);
}

TEST(LandmarkStore, WhatALandmarkWasMergedIntoStaysKnown) {
  LandmarkStore store = OneOfThreeLives();
  store.SetReplacedBy(1, 3);
  const LandmarkStore before = store;
  store.Compact();
  store.SetReplacedBy(4, 6);
  EXPECT_EQ(store.ReplacedBy(1), 3);
  EXPECT_EQ(store.ReplacedBy(4), 6);
  EXPECT_EQ(store.ReplacedBy(2), -1);
  EXPECT_EQ(before.ReplacedBy(4), -1);
}

TEST(LandmarkStore, CopiesStayAsTheyAreWhenOneIsCompacted) {
  LandmarkStore store = OneOfThreeLives();
  const LandmarkStore copy = store;
  store.Compact();
  store.Mutable(3).position.x() = -1;
  ExpectOneOfThreeLives(copy);
  EXPECT_EQ(copy[1].position.x(), 1);
  LandmarkStore other = store;
  other.Mutable(6).position.x() = -2;
  EXPECT_EQ(store[6].position.x(), 6);
  EXPECT_EQ(other[6].position.x(), -2);
}

TEST(LandmarkStore, WhatIsWrittenToOneThatIsGoneIsLost) {
  LandmarkStore store = OneOfThreeLives();
  store.Compact();
  store.Mutable(1).alive = true;
  EXPECT_FALSE(store[1].alive);
  EXPECT_FALSE(store.Mutable(2).alive);
}

TEST(LandmarkStore, ADeadOneTakesItsNumberAlone) {
  LandmarkStore store;
  store.Append(At(1));
  store.Append({}, 0);
  store.Append(At(2));
  EXPECT_FALSE(store[1].alive);
  EXPECT_EQ(store.ReplacedBy(1), 0);
  EXPECT_EQ(store[2].position.x(), 2);
}

TEST(LandmarkStore, ReferencesForWritingStayGoodWhileItGrows) {
  LandmarkStore store = Many();
  const LandmarkStore copy = store;  // the last chunk is copied by the next write
  Landmark& last = store.Mutable(kMany - 1);
  for (int i = 0; i < 100; ++i) store.Append(At(i));
  last.position.x() = -5;
  EXPECT_EQ(store[kMany - 1].position.x(), -5);
  EXPECT_EQ(copy[kMany - 1].position.x(), kMany - 1);
}

}  // namespace
}  // namespace tutti
