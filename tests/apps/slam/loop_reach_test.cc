#include "apps/slam/loop_reach.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/numbers.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

// A drive on which the lens is covered for a while: two map pieces, whose true places are known.
class LoopReachTest : public ::testing::Test {
 protected:
  static constexpr int kCovered = 40, kSeesAgain = 52, kEnd = 100;  // frames

  LoopReachTest()
      : recording_(testing::Record(testing::RenderedWorld(testing::SmallRgbdTown(320, 160)), kEnd)),
        odometry_(Options(), recording_.rig) {
    for (const InputFrame& frame : recording_.frames) {
      const bool covered = frame.index >= kCovered && frame.index < kSeesAgain;
      odometry_.Track(covered ? testing::Snow(frame) : frame);
    }
    odometry_.FinishMapping();
    for (const int id : odometry_.map().KeyframeIds()) {
      if (odometry_.map().keyframe(id).piece ==
          odometry_.map().keyframe(odometry_.map().KeyframeIds().front()).piece)
        before_.push_back(id);
      else
        after_.push_back(id);
    }
  }
  void SetUp() override {
    ASSERT_GT(before_.size(), 3u);
    ASSERT_GT(after_.size(), 3u);
  }
  static OdometryOptions Options() {
    OdometryOptions options;
    options.features = 800;
    options.relocalize_s = 0.35;
    return options;
  }
  Pose Truth(int id) const {
    return recording_.truth[static_cast<std::size_t>(odometry_.map().keyframe(id).frame_index)].pose;
  }
  /// What is true, but for the later end, which is `off` [m] to the side and turned.
  LoopEdge EdgeOf(int candidate, int query, double off, double turned_deg = 0) const {
    LoopEdge loop;
    loop.candidate = candidate;
    loop.query = query;
    Pose T = Truth(candidate).Inverse() * Truth(query);
    T.translation.x() += off;
    T.rotation *=
        Eigen::Quaterniond(Eigen::AngleAxisd(turned_deg * internal::kRadians, Eigen::Vector3d::UnitY()));
    loop.S_candidate_query = Similarity(T);
    loop.depth = 2;
    return loop;
  }

  testing::Recording recording_;
  Odometry odometry_;
  std::vector<int> before_, after_;  // keyframes
};

TEST_F(LoopReachTest, NoCameraJumpsWhileTrackingIsLost) {
  for (const int query : {after_.front(), after_.back()}) {
    EXPECT_EQ(WhyImpossible(EdgeOf(before_.front(), query, 0), odometry_.map(), Sensor::kRgbd), "");
    EXPECT_EQ(WhyImpossible(EdgeOf(before_.front(), query, 1), odometry_.map(), Sensor::kRgbd), "");
    EXPECT_THAT(WhyImpossible(EdgeOf(before_.front(), query, 60), odometry_.map(), Sensor::kRgbd),
                HasSubstr("would have jumped by"));
  }
}

TEST_F(LoopReachTest, WhereItWasTurnedToWhileTrackingIsLostIsAnyones) {
  EXPECT_EQ(WhyImpossible(EdgeOf(before_.back(), after_.front(), 0, 150), odometry_.map(), Sensor::kRgbd),
            "");
}

TEST_F(LoopReachTest, NoOdometryIsTurnedByARightAngle) {
  EXPECT_EQ(WhyImpossible(EdgeOf(after_.front(), after_.back(), 0, 40), odometry_.map(), Sensor::kRgbd), "");
  EXPECT_THAT(WhyImpossible(EdgeOf(after_.front(), after_.back(), 0, 90), odometry_.map(), Sensor::kRgbd),
              HasSubstr("turn by 90 deg"));
}

TEST_F(LoopReachTest, AnOdometryIsNotOffByMoreThanHalfOfTheWay) {
  EXPECT_TRUE(InReach(EdgeOf(after_.front(), after_.back(), 0), odometry_.map()));
  EXPECT_FALSE(InReach(EdgeOf(after_.front(), after_.back(), 60), odometry_.map()));
  EXPECT_TRUE(InReach(EdgeOf(before_.front(), after_.back(), 60), odometry_.map())) << "not of one piece";
}

}  // namespace
}  // namespace tutti
