#include "apps/slam/submap_joiner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "frontend/features/features.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_room.h"
#include "tutti/slam/loop.h"

namespace tutti {
namespace {

using testing::Recording;
using testing::Snow;

// The camera walks, is lost for a second, and walks back the way it came: a map of two submaps.
struct TornMap {
  TornMap() : room(testing::Record(testing::RenderedWorld(testing::SmallRgbdRoom(320, 240)), 50)) {
    config.run.threads = 1;
    config.run.loops = false;  // no detector is asked
    odometry.emplace(config.odometry, room.rig);
    loops.emplace(config, room.rig, nullptr);
    for (int i = 0; i < 50; ++i) Track(i, false);
    for (int i = 0; i < 15; ++i) Track(49, true);
    for (int i = 49; i >= 10; --i) Track(i, false);
    odometry->FinishMapping();
  }

  void Track(int frame, bool snow) {
    InputFrame input = room.frames[static_cast<std::size_t>(frame)];
    input.index = static_cast<std::int64_t>(truth.size());
    input.stamp_s = static_cast<double>(truth.size()) / 15;
    odometry->Track(snow ? Snow(input) : input);
    truth.push_back(room.truth[static_cast<std::size_t>(frame)].pose);
  }

  std::set<int> Pieces() const {
    std::set<int> pieces;
    for (const int id : odometry->map().KeyframeIds()) pieces.insert(odometry->map().keyframe(id).piece);
    return pieces;
  }

  RunConfig config;
  Recording room;
  std::vector<Pose> truth;
  std::optional<Odometry> odometry;
  std::optional<LoopCloser> loops;
};

TEST(SubmapJoiner, AStretchThatWasLostIsJoinedByTheKeyframesOfBothSides) {
  TornMap torn;
  ASSERT_EQ(torn.Pieces().size(), 2u);
  SubmapJoiner(torn.config, static_cast<std::int64_t>(torn.truth.size()), &*torn.loops, &*torn.odometry)
      .Join();
  EXPECT_EQ(torn.Pieces().size(), 1u);
  EXPECT_GE(CountAccepted(torn.loops->loops()), 2u);
  const Map& map = torn.odometry->map();
  for (const int id : map.KeyframeIds()) {
    const Pose& should = torn.truth[static_cast<std::size_t>(map.keyframe(id).frame_index)];
    const Pose& is = map.keyframe(id).T_world_camera;
    EXPECT_LT(((torn.truth[0].Inverse() * should).translation - is.translation).norm(), 0.05) << id;
  }
}

TEST(SubmapJoiner, WhatWasSeenElsewhereStaysApart) {
  TornMap torn;
  ASSERT_EQ(torn.Pieces().size(), 2u);
  // The same descriptors, but each landmark somewhere else: what matches fits no motion.
  Map map = torn.odometry->map();
  std::vector<int> second;
  for (const int id : map.KeyframeIds()) {
    if (map.keyframe(id).piece == 1) second.push_back(id);
  }
  cv::RNG random(3);
  for (const int l : map.LandmarksOf(second))
    map.landmark(l).position +=
        Eigen::Vector3d(random.uniform(-2., 2.), random.uniform(-2., 2.), random.uniform(-2., 2.));
  for (const int id : second) {
    auto features = std::make_shared<FrameFeatures>(*map.keyframe(id).features);
    for (cv::KeyPoint& k : features->keypoints)
      k.pt = {random.uniform(5.F, 300.F), random.uniform(5.F, 230.F)};
    map.keyframe(id).features = features;
  }
  torn.odometry->Replace(std::move(map));
  SubmapJoiner(torn.config, static_cast<std::int64_t>(torn.truth.size()), &*torn.loops, &*torn.odometry)
      .Join();
  EXPECT_EQ(torn.Pieces().size(), 2u);
  EXPECT_EQ(CountAccepted(torn.loops->loops()), 0u);
}

}  // namespace
}  // namespace tutti
