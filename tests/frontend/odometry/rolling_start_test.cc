#include "frontend/odometry/rolling_start.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "tests/frontend/geometry/rolling_scene.h"

namespace tutti {
namespace {

CameraRig RigOf(Sensor sensor, double readout_s) {
  CameraRig rig = testing::RollingRig();
  rig.sensor = sensor;
  rig.readout_s = readout_s;
  return rig;
}

// A map of one keyframe, which a moving camera made by its depths as if it had been at rest.
class RollingStartTest : public ::testing::Test {
 protected:
  RollingStartTest() {
    const auto seen = std::make_shared<FrameFeatures>(scene_.Features());
    seen->inverse_depth_sigma.assign(seen->size(), 0.001F);
    seen->descriptors = cv::Mat::zeros(static_cast<int>(seen->keypoints.size()), 32, CV_8U);
    seen->BuildGrid(rig_.camera.width, rig_.camera.height);
    Keyframe k;
    k.features = seen;
    k.T_world_camera = scene_.T_camera_world.Inverse();
    const int id = map_.AddKeyframe(std::move(k));
    for (std::size_t f = 0; f < points_.size(); ++f) {
      const cv::Point2f at = seen->keypoints[f].pt;
      const Eigen::Vector3d taken = rig_.camera.Unproject({at.x, at.y}) / double(seen->inverse_depth[f]);
      map_.AddLandmark(scene_.T_camera_world.Inverse() * taken, id, static_cast<int>(f));
    }
    first_.frame = {0, 0, seen};
    first_.T_camera_world = scene_.T_camera_world;
    first_.reference = first_.newest_keyframe = id;
    seen_ = seen;
  }

  // Of the landmarks, from where they are [m].
  double Farthest() const {
    double farthest = 0;
    for (std::size_t f = 0; f < points_.size(); ++f)
      farthest = std::max(farthest, (map_.landmark(static_cast<int>(f)).position - points_[f]).norm());
    return farthest;
  }

  const testing::RollingScene scene_{0.01};
  const CameraRig& rig_ = scene_.rig;
  const Vector6d& motion_ = scene_.motion;
  const std::vector<Eigen::Vector3d>& points_ = scene_.points;  // in the world
  Map map_{std::vector<float>{1}};
  std::shared_ptr<const FrameFeatures> seen_;
  LastFrame first_;
};

TEST_F(RollingStartTest, LandmarksAreWhereTheMovingCameraSawThem) {
  ASSERT_GT(points_.size(), 60U);
  EXPECT_GT(Farthest(), 0.05) << "as if it had been at rest";
  const auto straight = RollingStart(rig_).Straighten(*seen_, motion_, 0, &map_);
  EXPECT_LT(Farthest(), 1e-4);
  EXPECT_EQ(map_.keyframe(0).features, straight);
  const cv::Point2f raw = seen_->keypoints[0].pt, at = straight->keypoints[0].pt;
  EXPECT_LT((Eigen::Vector2d(at.x - raw.x, at.y - raw.y) - straight->Rolled(0)).norm(), 1e-4);
}

TEST_F(RollingStartTest, AMotionThatWasWrongIsTakenBack) {
  const RollingStart start(rig_);
  const Eigen::Vector3d before = map_.landmark(0).position;
  start.Straighten(*seen_, 2 * motion_, 0, &map_);
  EXPECT_GT((map_.landmark(0).position - before).norm(), 1e-3);
  start.Straighten(*seen_, Vector6d::Zero(), 0, &map_);
  EXPECT_LT((map_.landmark(0).position - before).norm(), 1e-5);
}

// Rows of the two frames tell how much faster the second one moves, whatever is assumed of the first.
TEST_F(RollingStartTest, TheStepAndTheChangeOfTheMotionTellHowItBegan) {
  const double dt = 1.0 / 30;
  Vector6d change;
  change << 0.1, 0.2, -0.1, 0.4, -0.3, 0.2;
  PoseFix next(TrackedFrame{1, dt, seen_});
  next.T_camera_world = ExpSE3((motion_ + 0.5 * change) * dt) * first_.T_camera_world;
  for (const double assumed : {0.0, 0.5, 1.5}) {
    next.motion = assumed * motion_ + change;
    const auto found = RollingStart::MotionOf(first_, next, assumed * motion_);
    ASSERT_TRUE(found);
    EXPECT_LT((*found - motion_).norm(), 1e-9) << assumed;
  }
  next.motion.reset();
  EXPECT_FALSE(RollingStart::MotionOf(first_, next, motion_)) << "its rows say nothing";
  next.motion = motion_;
  next.frame.stamp_s = 0.5;
  EXPECT_FALSE(RollingStart::MotionOf(first_, next, motion_)) << "too long ago";
}

TEST_F(RollingStartTest, OnlyAFrameThatMadeAMapIsOne) {
  EXPECT_TRUE(RollingStart(rig_).Is(first_));
  EXPECT_FALSE(RollingStart(RigOf(Sensor::kRgbd, 0)).Is(first_)) << "a global shutter";
  EXPECT_FALSE(RollingStart(RigOf(Sensor::kMono, 0.03)).Is(first_)) << "no depth";
  LastFrame last = first_;
  last.frames_since_keyframe = 1;
  EXPECT_FALSE(RollingStart(rig_).Is(last));
  last = first_;
  last.frame.features = RollingStart(rig_).Straighten(*seen_, motion_, 0, &map_);
  EXPECT_FALSE(RollingStart(rig_).Is(last)) << "it is straight";
  EXPECT_FALSE(RollingStart(rig_).Is(LastFrame())) << "no map";
}

}  // namespace
}  // namespace tutti
