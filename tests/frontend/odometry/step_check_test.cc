// What images say of the steps of an odometry whose errors are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/numbers.h"
#include "frontend/odometry/step_check.h"
#include "tests/frontend/odometry/tracked_scene.h"
#include "tests/support/recording.h"
#include "tests/support/small_town.h"
#include "tutti/frontend/odometry.h"

namespace tutti {
namespace {

using testing::Recording;

constexpr std::size_t kCheckedFrames = 60;

Recording Street(SyntheticSensor sensor) {
  SyntheticOptions options = testing::SmallStereoTown(320, 160);
  options.sensor = sensor;
  return testing::Record(SyntheticWorld(options), kCheckedFrames);
}

// Of all keyframes whose step the images could check. After each step the odometry turns by `yaw_deg`, and
// its steps are longer by this factor.
std::vector<StepCheck> Checks(const Recording& street, double yaw_deg, double factor) {
  OdometryOptions options;
  options.features = 600;
  Odometry odometry(options, street.rig);
  std::vector<StepCheck> checks;
  Pose T_odom_camera = street.truth.front().pose;
  for (std::size_t i = 0; i < street.frames.size(); ++i) {
    if (i > 0) {
      Pose step = street.truth[i - 1].pose.Inverse() * street.truth[i].pose;
      step.translation *= factor;
      step.rotation = (step.rotation * ExpSO3({0, yaw_deg * internal::kRadians, 0})).normalized();
      T_odom_camera = T_odom_camera * step;
    }
    const TrackResult result = odometry.Follow(street.frames[i], T_odom_camera);
    if (result.step) {
      EXPECT_GE(result.keyframe, 0);
      checks.push_back(*result.step);
    }
  }
  EXPECT_GT(checks.size(), 8u);
  return checks;
}

double MedianYawDeg(const std::vector<StepCheck>& checks) {
  std::vector<double> values;
  values.reserve(checks.size());
  for (const StepCheck& check : checks) values.push_back(check.rotation_rad.y() * internal::kDegrees);
  return internal::Median(std::move(values));
}

double MedianShareAhead(const std::vector<StepCheck>& checks) {
  std::vector<double> values;
  values.reserve(checks.size());
  for (const StepCheck& check : checks) values.push_back(check.translation_m.z() / check.way_m);
  return internal::Median(std::move(values));
}

TEST(StepCheck, OfATrueOdometryIsWithinWhatTheImagesErrBy) {
  const std::vector<StepCheck> checks = Checks(Street(SyntheticSensor::kStereo), 0, 1);
  EXPECT_LT(std::abs(MedianYawDeg(checks)), 0.05);
  EXPECT_LT(std::abs(MedianShareAhead(checks)), 0.03);
  for (const StepCheck& check : checks) {
    EXPECT_GT(check.sigma_translation_m, 0);
    EXPECT_GT(check.sigma_rotation_rad, 0);
  }
}

TEST(StepCheck, FindsAHeadingThatTurnsAway) {
  const Recording street = Street(SyntheticSensor::kStereo);
  const double right = MedianYawDeg(Checks(street, 0.3, 1)), left = MedianYawDeg(Checks(street, -0.3, 1));
  EXPECT_GT(std::min(std::abs(right), std::abs(left)), 0.25);
  EXPECT_LT(right * left, 0);
}

// T_seen = Exp(e) T_given, and the world comes nearer by less than was given: e is ahead.
TEST(StepCheck, FindsStepsThatAreTooLong) {
  EXPECT_NEAR(MedianShareAhead(Checks(Street(SyntheticSensor::kStereo), 0, 1.2)), 0.2 / 1.2, 0.05);
}

// A walk to the side; the map has the poses as `as_mapped` makes them of the true ones.
class ImagesContradictTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  template <class AsMapped>
  bool Contradicted(const AsMapped& as_mapped) const {
    Map map(PyramidScales(OdometryOptions()));
    for (int i = 0; i < 6; ++i) {
      const Pose pose = testing::Moved(0.1 * i, 0.02 * i, 0.03 * i);
      const TrackedFrame frame = Frame(pose, 0.1 * i);
      Keyframe keyframe;
      keyframe.frame_index = i;
      keyframe.stamp_s = frame.stamp_s;
      keyframe.features = frame.features;
      keyframe.landmarks.assign(frame.features->size(), -1);
      keyframe.T_world_camera = as_mapped(pose);
      map.AddKeyframe(keyframe);
    }
    return ImagesContradict(map, camera_, 5, OdometryOptions().min_inliers);
  }
};

TEST_F(ImagesContradictTest, AMapThatHasTheWayAtAnyScaleIsNot) {
  EXPECT_FALSE(Contradicted([](const Pose& pose) { return pose; }));
  EXPECT_FALSE(Contradicted([](const Pose& pose) { return Pose(pose.rotation, 0.1 * pose.translation); }));
}

TEST_F(ImagesContradictTest, AMapThatHasAnotherWayIs) {
  EXPECT_TRUE(Contradicted([](const Pose& pose) {
    return Pose(pose.rotation, {0, pose.translation.x(), pose.translation.z()});
  }));
}

}  // namespace
}  // namespace tutti
