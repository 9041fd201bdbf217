#include "apps/slam/odometry_jumps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "apps/slam/trajectory_correction.h"
#include "core/numbers.h"

namespace tutti {
namespace {

using internal::kRadians;

// A vehicle at 10 Hz that speeds up, turns and stops, with a centimetre of noise.
Trajectory SteadyDrive(std::size_t poses, double scale = 1) {
  Trajectory drive;
  double heading = 0, noise = 0.3;
  Eigen::Vector3d at(3, -2, 1);
  for (std::size_t i = 0; i < poses; ++i) {
    const double t = 0.1 * static_cast<double>(i);
    const double speed = i < 12 || (i > 60 && i < 80) ? 0 : std::min(8.0, 0.8 * static_cast<double>(i - 11));
    heading += 0.1 * 0.5 * std::sin(0.4 * t);
    at += 0.1 * speed * Eigen::Vector3d(std::cos(heading), std::sin(heading), 0);
    noise = std::fmod(7.3 * noise + 0.41, 1.0);
    const Eigen::Vector3d wrong = 0.01 * Eigen::Vector3d(noise - 0.5, 0.5 - noise, 0);
    drive.push_back({t, Pose(ExpSO3({0, 0, heading}), scale * (at + wrong))});
  }
  return drive;
}

Pose Off(const Pose& pose, double metres, double degrees = 0) {
  return {pose.rotation * ExpSO3({0, degrees * kRadians, 0}),
          pose.translation + metres * Eigen::Vector3d(0.6, -0.8, 0)};
}

TEST(OdometryJumps, WhatMovesHasNone) {
  const Trajectory drive = SteadyDrive(300);
  EXPECT_TRUE(FindJumps(drive).empty());
  for (const double scale : {1e-3, 1e10}) EXPECT_TRUE(FindJumps(SteadyDrive(300, scale)).empty()) << scale;
  Trajectory far = drive, sparse;
  for (std::size_t i = 0; i < drive.size(); ++i) {
    far[i].pose.translation += Eigen::Vector3d(4e5, 5e6, 0);  // UTM
    if (i % 10 == 0) sparse.push_back(drive[i]);
  }
  EXPECT_TRUE(FindJumps(far).empty());
  EXPECT_TRUE(FindJumps(sparse).empty());
  // No pose while it drives on for a second.
  Trajectory gap = drive;
  gap.erase(gap.begin() + 150, gap.begin() + 160);
  EXPECT_TRUE(FindJumps(gap).empty());
}

TEST(OdometryJumps, PosesThatAreOffAreFoundAndReplacedWhereverTheyAre) {
  const Trajectory drive = SteadyDrive(101);
  for (const double metres : {1.0, 10.0, 100.0, 1e10}) {
    for (const std::size_t first : {0U, 3U, 50U, 70U, 99U, 100U}) {
      for (const std::size_t count : {1U, 2U}) {
        Trajectory bad = drive;
        for (std::size_t i = first; i < std::min(bad.size(), first + count); ++i)
          bad[i].pose = Off(bad[i].pose, metres, 20);
        const std::vector<OdometryJump> jumps = FindJumps(bad);
        const std::string what =
            std::to_string(metres) + " m at " + std::to_string(first) + ", " + std::to_string(count);
        ASSERT_EQ(jumps.size(), 1U) << what;
        EXPECT_TRUE(jumps[0].comes_back) << what;
        EXPECT_NEAR(jumps[0].distance_m, metres, 1 + 1e-6 * metres) << what;
        const Trajectory mended = CorrectTrajectory(bad, {}, {}, jumps);
        ASSERT_EQ(mended.size(), bad.size());
        for (std::size_t i = 0; i < bad.size(); ++i) {
          EXPECT_EQ(mended[i].stamp_s, bad[i].stamp_s);
          EXPECT_LT((mended[i].pose.translation - drive[i].pose.translation).norm(), 1.7)
              << what << ": " << i;
        }
      }
    }
  }
}

TEST(OdometryJumps, APoseThatIsTurnedIsOne) {
  const Trajectory drive = SteadyDrive(101);
  Trajectory bad = drive;
  bad[50].pose = Off(bad[50].pose, 0, 30);
  const std::vector<OdometryJump> jumps = FindJumps(bad);
  ASSERT_EQ(jumps.size(), 1U);
  EXPECT_NEAR(jumps[0].angle_rad, 30 * kRadians, 0.02);
  EXPECT_TRUE(jumps[0].comes_back);
}

TEST(OdometryJumps, AnOdometryThatBeginsAnewJumpsOnceAndForGood) {
  const Trajectory drive = SteadyDrive(101);
  Trajectory restarted = drive;
  for (std::size_t i = 50; i < drive.size(); ++i)
    restarted[i].pose = drive[50].pose.Inverse() * drive[i].pose;
  const std::vector<OdometryJump> jumps = FindJumps(restarted);
  ASSERT_EQ(jumps.size(), 1U);
  EXPECT_FALSE(jumps[0].comes_back);
  EXPECT_EQ(jumps[0].from_s, drive[49].stamp_s);
  EXPECT_EQ(jumps[0].to_s, drive[50].stamp_s);
  EXPECT_THAT(Sentence(jumps[0]),
              ::testing::HasSubstr("between 4.900000 s and 5.000000 s; this step has no"));
  // A correction of what was before does not reach beyond.
  const Pose moved(ExpSO3({0, 0, 0.1}), {1, 2, 3});
  const Trajectory corrected =
      CorrectTrajectory(restarted, {restarted[40], restarted[60]},
                        {{restarted[40].stamp_s, moved * restarted[40].pose}, restarted[60]}, jumps);
  EXPECT_LT((corrected[49].pose.translation - (moved * restarted[49].pose).translation).norm(), 1e-9);
  EXPECT_LT((corrected[50].pose.translation - restarted[50].pose.translation).norm(), 1e-9);
}

TEST(OdometryJumps, AreToldOnceWhilePosesComeIn) {
  Trajectory bad = SteadyDrive(700);
  bad[0].pose = Off(bad[0].pose, 1e10);
  bad[300].pose = Off(bad[300].pose, 5);
  for (std::size_t i = 600; i < bad.size(); ++i) bad[i].pose = Off(bad[i].pose, 30);
  bad[699].pose = Off(bad[699].pose, 10);
  JumpWatch watch;
  std::vector<double> ends;
  const auto take = [&](bool all) {
    for (const OdometryJump& jump : watch.Take(all))
      ends.push_back(std::isfinite(jump.to_s) ? jump.to_s : jump.from_s);
    return ends.size();
  };
  for (std::size_t i = 0; i < bad.size(); ++i) {
    watch.Add(bad[i]);
    take(false);
    const std::size_t expected = i == 40 ? 1 : i == 325 ? 2 : i == 625 ? 3 : ends.size();
    EXPECT_EQ(ends.size(), expected) << i;
  }
  EXPECT_EQ(take(true), 4U);
  EXPECT_EQ(take(true), 4U);
}

}  // namespace
}  // namespace tutti
