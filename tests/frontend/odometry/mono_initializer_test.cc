#include "frontend/odometry/mono_initializer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "frontend/geometry/rolling_shutter.h"
#include "tests/frontend/odometry/tracked_scene.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;
using testing::Moved;

class MonoInitializerTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  // Offers a first view and, 0.1 s later, one that has moved so far to the side.
  bool Start(double sideways, const OdometryOptions& options = OdometryOptions()) {
    MonoInitializer initializer(options, Rig());
    map_made_ = Map(PyramidScales(options));
    reason_.clear();
    EXPECT_FALSE(initializer.Offer(Frame(Pose(), 0), 0, Pose(), 1, &map_made_, &reason_));
    return initializer.Offer(Frame(Moved(sideways, 0, 0.02), 0.1), 0, Pose(), 1, &map_made_, &reason_);
  }

  Map map_made_{PyramidScales(OdometryOptions())};
  std::string reason_;
};

TEST_F(MonoInitializerTest, StartsFromTwoViewsThatAreFarApart) {
  ASSERT_TRUE(Start(0.6)) << reason_;
  ASSERT_EQ(map_made_.KeyframeCount(), 2);
  const Pose T_first_second = map_made_.keyframe(1).T_world_camera;
  EXPECT_GT(T_first_second.translation.normalized().x(), 0.9999);
  EXPECT_NEAR(LogSO3(T_first_second.rotation).y(), 0.02, 1e-4);
  EXPECT_NEAR(map_made_.MedianDepth(0), 1, 0.02);
  EXPECT_GT(map_made_.LandmarkCount(), 100);
}

TEST_F(MonoInitializerTest, WaitsWhileATurnAndASidewaysStepLookTheSame) {
  EXPECT_FALSE(Start(0.14));
  EXPECT_THAT(reason_, HasSubstr("the direction of motion is known to"));
  EXPECT_EQ(map_made_.KeyframeCount(), 0);
  EXPECT_EQ(map_made_.LandmarkCount(), 0);
  OdometryOptions bold;  // there is parallax enough, and nothing else that speaks against this pair
  bold.max_direction_sigma_deg = 90;
  EXPECT_TRUE(Start(0.14, bold)) << reason_;
}

// What a frame shows between two columns of the image.
TrackedFrame WithinColumns(const TrackedFrame& frame, float left, float right, const PinholeCamera& camera) {
  auto part = std::make_shared<FrameFeatures>();
  for (std::size_t f = 0; f < frame.features->size(); ++f) {
    const cv::KeyPoint& k = frame.features->keypoints[f];
    if (k.pt.x < left || k.pt.x >= right) continue;
    part->keypoints.push_back(k);
    part->descriptors.push_back(frame.features->descriptors.row(static_cast<int>(f)));
  }
  part->inverse_depth.assign(part->size(), 0);
  part->inverse_depth_sigma.assign(part->size(), 0);
  part->BuildGrid(camera.width, camera.height);
  TrackedFrame out = frame;
  out.features = part;
  return out;
}

// The camera turns to the right: what the first view shows is soon out of sight.
TEST_F(MonoInitializerTest, AYoungerViewTakesThePlaceOfOneThatIsOutOfSight) {
  MonoInitializer initializer(OdometryOptions(), Rig());
  Map map(PyramidScales(OdometryOptions()));
  const float width = static_cast<float>(camera_.width);
  const auto offer = [&](double x, double stamp_s, float left, float right) {
    const TrackedFrame frame =
        WithinColumns(Frame(Moved(x, 0), stamp_s), left * width, right * width, camera_);
    return initializer.Offer(frame, 0, Pose(), 1, &map, &reason_);
  };
  EXPECT_FALSE(offer(0, 0, 0, 0.5F));
  EXPECT_FALSE(offer(0.02, 0.3, 0, 1));
  ASSERT_TRUE(offer(0.6, 0.6, 0.3F, 1)) << reason_;
  EXPECT_NEAR(map.keyframe(0).stamp_s, 0.3, 1e-9);
}

TEST_F(MonoInitializerTest, KeepsTheFramesThatWait) {
  MonoInitializer initializer(OdometryOptions(), Rig());
  Map map(PyramidScales(OdometryOptions()));
  for (int i = 0; i < 3; ++i)
    EXPECT_FALSE(initializer.Offer(Frame(Moved(0.05 * i, 0), 0.1 * i), 0, Pose(), 1, &map, &reason_));
  EXPECT_EQ(initializer.pending().size(), 3);
  EXPECT_TRUE(initializer.Offer(Frame(Moved(0.6, 0), 0.3), 0, Pose(), 1, &map, &reason_)) << reason_;
}

// A hand shakes a camera that moves to the side: rows that are read later see a camera that has turned on.
TEST_F(MonoInitializerTest, ViewsOfARollingShutterAreStraightenedByHowItTurns) {
  CameraRig rig = Rig();
  rig.readout_s = 0.03;
  const RollingShutter shutter(rig);
  const auto pose = [](double t) { return Moved(0.5 * t, 0, 0.2 * std::sin(2 * M_PI * t)); };
  MonoInitializer initializer(OdometryOptions(), rig);
  bool started = false;
  for (int i = 0; i < 40 && !started; ++i) {
    const double t = i / 20.0, turn = -0.2 * 2 * M_PI * std::cos(2 * M_PI * t);  // of T_camera_world
    TrackedFrame frame = Frame(pose(t), t);
    auto rolled = std::make_shared<FrameFeatures>(*frame.features);
    for (cv::KeyPoint& k : rolled->keypoints) {
      const Eigen::Vector3d ray = rig.camera.Unproject({k.pt.x, k.pt.y});
      const Eigen::Vector2d pixel = rig.camera.Project(ExpSO3({0, turn * shutter.TimeOf(k.pt.y), 0}) * ray);
      k.pt.x = static_cast<float>(pixel.x());
      k.pt.y = static_cast<float>(pixel.y());
    }
    rolled->BuildGrid(rig.camera.width, rig.camera.height);
    frame.features = rolled;
    started = initializer.Offer(frame, 0, Pose(), 1, &map_made_, &reason_);
  }
  ASSERT_TRUE(started) << reason_;
  const Pose is = map_made_.keyframe(1).T_world_camera,
             should = pose(map_made_.keyframe(0).stamp_s).Inverse() * pose(map_made_.keyframe(1).stamp_s);
  EXPECT_GT(is.translation.normalized().dot(should.translation.normalized()), 0.998);
  EXPECT_LT(LogSO3(is.rotation.conjugate() * should.rotation).norm(), 0.005);
}

}  // namespace
}  // namespace tutti
