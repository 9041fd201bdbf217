#include "loopclosure/filter/transition_model.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace tutti {
namespace {

// A chain of `n` locations in working memory (STM of one beside them).
LocationMemory Chain(int n, TransitionModel& model) {
  LocationMemory memory(1);
  for (int i = 0; i <= n; ++i) {
    memory.Add(i);
    model.Update(memory, memory.Settle());
  }
  return memory;
}

double At(const TransitionModel& model, int j, int i) {
  for (const auto& [slot, value] : model.Column(j)) {
    if (slot == i) return value;
  }
  return 0.0;
}

double Sum(const TransitionModel& model, int j) {
  double sum = 0.0;
  for (const auto& [slot, value] : model.Column(j)) sum += value;
  return sum;
}

TEST(TransitionModel, MiddleOfAChainHasThePublishedValues) {
  TransitionModel model;
  Chain(60, model);
  EXPECT_NEAR(At(model, 30, 30), 0.225, 1e-4);
  for (const int side : {-1, 1}) {
    EXPECT_NEAR(At(model, 30, 30 + side), 0.1875, 1e-4);
    EXPECT_NEAR(At(model, 30, 30 + 2 * side), 0.10, 1e-4);
    EXPECT_NEAR(At(model, 30, 30 + 3 * side), 0.0388, 1e-4);
    EXPECT_NEAR(At(model, 30, 30 + 4 * side), 0.0094, 1e-4);
  }
  EXPECT_EQ(model.Column(30).size(), 33u);
}

TEST(TransitionModel, EveryColumnSumsToNineTenths) {
  TransitionModel model;
  Chain(40, model);
  for (int j = 0; j < 40; ++j) EXPECT_NEAR(Sum(model, j), 0.9, 1e-12) << j;
}

TEST(TransitionModel, ALoneLocationKeepsTheDeficitToItself) {
  TransitionModel model;
  Chain(1, model);
  EXPECT_NEAR(At(model, 0, 0), 0.9, 1e-12);
}

TEST(TransitionModel, WhatLiesBehindALoopLinkHasAShareOfItsLevel) {
  TransitionModel model;
  LocationMemory memory = Chain(60, model);
  ASSERT_TRUE(memory.AddLink(10, 50, LocationMemory::LinkType::kLoop));
  model.Update(memory, {10, 50});
  EXPECT_NEAR(At(model, 10, 50), TransitionModel::kLoopShare * At(model, 10, 10), 1e-12);
  EXPECT_NEAR(At(model, 10, 51), TransitionModel::kLoopShare * At(model, 10, 11), 1e-12);
  EXPECT_NEAR(Sum(model, 10), 0.9, 1e-12);
}

TEST(TransitionModel, CachedColumnsEqualThoseOfAFreshModel) {
  TransitionModel grown;
  LocationMemory memory = Chain(50, grown);
  memory.AddLink(5, 40, LocationMemory::LinkType::kLoop);
  grown.Update(memory, {5, 40});
  TransitionModel fresh;
  fresh.Update(memory, memory.working_memory());
  for (const int j : memory.working_memory()) EXPECT_EQ(grown.Column(j), fresh.Column(j)) << j;
}

// Laps around a block: every location closes a loop with one of the lap before, or of the first.
std::size_t LargestColumn(int laps, int block, bool with_the_first, TransitionModel& model) {
  LocationMemory memory(1);
  for (int i = 0; i < laps * block; ++i) {
    memory.Add(i);
    model.Update(memory, memory.Settle());
    const int older = with_the_first ? i % block : i - block;
    // It is in short-term memory still: its links count from when it enters working memory.
    if (i >= block) memory.AddLink(i, older, LocationMemory::LinkType::kLoop);
  }
  std::size_t most = 0;
  for (const int j : memory.working_memory()) most = std::max(most, model.Column(j).size());
  TransitionModel fresh;
  fresh.Update(memory, memory.working_memory());
  for (const int j : memory.working_memory()) {
    EXPECT_EQ(model.Column(j), fresh.Column(j)) << j;
    EXPECT_NEAR(Sum(model, j), 0.9, 1e-12) << j;
  }
  return most;
}

TEST(TransitionModel, ColumnsStayBoundedHoweverManyLaps) {
  for (const bool with_the_first : {false, true}) {
    TransitionModel few;
    TransitionModel many;
    const std::size_t of_few = LargestColumn(8, 25, with_the_first, few);
    EXPECT_EQ(LargestColumn(50, 25, with_the_first, many), of_few);
    EXPECT_LE(of_few, 33u * 5u);  // the neighbours in one lap, five times
  }
}

TEST(TransitionModel, PredictionEqualsTheDenseProduct) {
  TransitionModel model;
  const LocationMemory memory = Chain(30, model);
  const std::vector<int>& wm = memory.working_memory();
  Belief before;
  before.new_place = 0.4;
  before.places.assign(31, 0.0);
  for (const int i : wm) before.places[static_cast<std::size_t>(i)] = 0.6 / static_cast<double>(wm.size());
  const Belief after = model.Predict(before, wm);
  EXPECT_NEAR(after.new_place, 0.9 * 0.4 + 0.1 * 0.6, 1e-12);
  for (const int i : wm) {
    double expected = 0.1 / static_cast<double>(wm.size()) * before.new_place;
    for (const int j : wm) expected += At(model, j, i) * before.places[static_cast<std::size_t>(j)];
    EXPECT_NEAR(after.places[static_cast<std::size_t>(i)], expected, 1e-12);
  }
  double sum = after.new_place;
  for (const double p : after.places) sum += p;
  EXPECT_NEAR(sum, 1.0, 1e-12);
}

// <b, T a> = <T' b, a>: what is predicted forwards and what is looked for backwards is one matrix.
TEST(TransitionModel, BackwardIsTheTransposeOfThePrediction) {
  TransitionModel model;
  const LocationMemory memory = Chain(25, model);
  Belief a, b;
  for (int i = 0; i < 26; ++i) {
    const bool in = i < 25;
    a.places.push_back(in ? 0.01 * (1 + i % 7) : 0.0);
    b.places.push_back(in ? 0.3 + 0.1 * (i % 5) : 0.0);
  }
  a.new_place = 0.4;
  b.new_place = 1.7;
  const Belief forward = model.Predict(a, memory.working_memory());
  const Belief backward = model.Backward(b, memory.working_memory());
  double left = forward.new_place * b.new_place, right = backward.new_place * a.new_place;
  for (std::size_t i = 0; i < 25; ++i) {
    left += forward.places[i] * b.places[i];
    right += backward.places[i] * a.places[i];
  }
  EXPECT_NEAR(left, right, 1e-12);
}

}  // namespace
}  // namespace tutti
