// How much of a reference an estimate covers: known answers.
#include <gtest/gtest.h>

#include <vector>

#include "tutti/backend/evaluation.h"

namespace tutti {
namespace {

constexpr double kTolerance = 0.01;  // [s]

// Poses at the frames first, first + 1, ..., last of a 10 Hz camera, without those for which `left_out`
// holds.
template <typename LeftOut>
Trajectory Frames(int first, int last, const LeftOut& left_out) {
  Trajectory out;
  for (int k = first; k <= last; ++k) {
    if (!left_out(k)) out.push_back({100 + 0.1 * k, Pose()});
  }
  return out;
}

Trajectory Frames(int first, int last) {
  return Frames(first, last, [](int) { return false; });
}

TrajectoryCoverage Covered(const Trajectory& reference, const Trajectory& estimate, double offset_s = 0,
                           const std::vector<double>& frames = {}) {
  return CoverageOf(reference, estimate, offset_s, kTolerance, frames);
}

TEST(TrajectoryCoverage, EveryFramePosedIsAll) {
  const TrajectoryCoverage c = Covered(Frames(0, 999), Frames(0, 999));
  EXPECT_EQ(c.posed, 1000u);
  EXPECT_EQ(c.all, 1000u);
  EXPECT_EQ(c.share(), 1.0);
}

TEST(TrajectoryCoverage, FramesLostAtTheStartInBetweenAndAtTheEndAreMissing) {
  EXPECT_EQ(Covered(Frames(0, 999), Frames(100, 999)).all, 1000u);
  EXPECT_EQ(Covered(Frames(0, 999), Frames(100, 999)).posed, 900u);
  EXPECT_EQ(Covered(Frames(0, 999), Frames(0, 899)).all, 1000u);
  const auto lost = [](int k) { return (k >= 300 && k < 350) || k % 10 == 3; };
  const TrajectoryCoverage c = Covered(Frames(0, 999), Frames(0, 999, lost));
  EXPECT_EQ(c.all, 1000u);
  EXPECT_EQ(c.posed, 1000u - 50 - 95);
}

TEST(TrajectoryCoverage, TheRatesOfReferenceAndEstimateMayDiffer) {
  Trajectory fast;  // 200 Hz from 100.004 s to 199.9 s, as a motion-capture system
  for (int k = 0; 100.004 + 0.005 * k <= 199.9; ++k) fast.push_back({100.004 + 0.005 * k, Pose()});
  EXPECT_EQ(Covered(fast, Frames(0, 999)).share(), 1.0);
  EXPECT_NEAR(Covered(fast, Frames(500, 999)).share(), 0.5, 1e-3);
}

TEST(TrajectoryCoverage, WhatIsOutsideOfTheReferenceDoesNotCount) {
  const TrajectoryCoverage c = Covered(Frames(400, 599), Frames(0, 999));
  EXPECT_EQ(c.posed, 200u);
  EXPECT_EQ(c.all, 200u);
  EXPECT_EQ(Covered(Frames(400, 599), Frames(0, 99)).posed, 0u);
  EXPECT_EQ(Covered(Frames(400, 599), Frames(0, 99)).all, 200u);
}

TEST(TrajectoryCoverage, JitterOfStampsIsNoGap) {
  Trajectory uneven = Frames(0, 999);
  for (std::size_t k = 0; k < uneven.size(); ++k) uneven[k].stamp_s += k % 3 == 0 ? 0.003 : -0.002;
  EXPECT_EQ(Covered(Frames(0, 999), uneven).share(), 1.0);
}

TEST(TrajectoryCoverage, TheOffsetIsAddedToTheEstimate) {
  Trajectory late = Frames(0, 999);
  for (StampedPose& pose : late) pose.stamp_s += 50;
  EXPECT_EQ(Covered(Frames(0, 999), late).posed, 500u);
  EXPECT_EQ(Covered(Frames(0, 999), late, -50).posed, 1000u);
}

TEST(TrajectoryCoverage, WithTheImagesStampsTheFiguresAreExact) {
  // The reference begins 10 s before the images; every third frame, unevenly, is a keyframe.
  std::vector<double> frames;
  for (int k = 100; k < 400; ++k) frames.push_back(100 + 0.1 * k);
  const auto no_keyframe = [](int k) { return k % 6 != 0 && k % 6 != 1; };
  const TrajectoryCoverage c = Covered(Frames(0, 999), Frames(100, 399, no_keyframe), 0, frames);
  EXPECT_EQ(c.all, 300u);
  EXPECT_EQ(c.posed, 100u);
  EXPECT_EQ(Covered(Frames(0, 999), Frames(100, 399), 0, frames).share(), 1.0);
  EXPECT_LT(Covered(Frames(0, 999), Frames(100, 399)).share(), 0.31);
}

TEST(TrajectoryCoverage, TheOffsetIsAddedToTheImagesStampsToo) {
  // The clock of the images is 50 s late, and so are the stamps of the poses.
  std::vector<double> frames;
  Trajectory late = Frames(0, 499);
  for (StampedPose& pose : late) pose.stamp_s += 50;
  frames.reserve(1000);
  for (int k = 0; k < 1000; ++k) frames.push_back(150 + 0.1 * k);
  const TrajectoryCoverage c = Covered(Frames(0, 999), late, -50, frames);
  EXPECT_EQ(c.all, 1000u);
  EXPECT_EQ(c.posed, 500u);
}

TEST(TrajectoryCoverage, OnePoseIsOneOfTheReferences) {
  const TrajectoryCoverage c = Covered(Frames(0, 99), Frames(50, 50));
  EXPECT_EQ(c.posed, 1u);
  EXPECT_EQ(c.all, 100u);
  EXPECT_EQ(Covered({}, Frames(0, 9)).share(), 0.0);
}

}  // namespace
}  // namespace tutti
