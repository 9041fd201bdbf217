#include "apps/slam/map_reference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <random>
#include <vector>

#include "core/numbers.h"
#include "frontend/features/features.h"
#include "tutti/backend/pose_graph.h"

namespace tutti {
namespace {

constexpr int kKeyframes = 120;

// Up a long hall and back, the camera's z axis ahead; world z is up.
Pose WalkedTo(int k) {
  const double t = 0.25 * k;
  const Eigen::Quaterniond ahead(Eigen::AngleAxisd(-M_PI / 2, Eigen::Vector3d::UnitX()));  // z ahead, y down
  return Pose(ExpSO3({0, 0, 0.05 * t}) * ahead, Eigen::Vector3d(t, 0.1 * t * t, 0));
}

struct WalkDone {
  Map map{std::vector<float>{1}};
  PoseGraph graph{GraphKind::kSE3};
  ImuReport imu;
};

// The odometry turns by so much more at each keyframe about the way; two seconds are two keyframes.
WalkDone WalkDownTheHall(double bend_rad, double scatter_rad) {
  WalkDone walked;
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, scatter_rad);
  const auto nothing_seen = std::make_shared<const FrameFeatures>();
  Pose odometry = WalkedTo(0);
  for (int k = 0; k < kKeyframes; ++k) {
    if (k > 0) {
      Pose step = WalkedTo(k - 1).Inverse() * WalkedTo(k);
      step.rotation = step.rotation * ExpSO3({0, 0, bend_rad});
      walked.graph.AddNode(k, Similarity(odometry * step));
      walked.graph.AddOdometry(k - 1, k, Similarity(step), MakeInformation(0.005, 0.002));
      odometry = odometry * step;
    } else {
      walked.graph.AddNode(0, Similarity(odometry));
    }
    Keyframe keyframe;
    keyframe.features = nothing_seen;
    keyframe.frame_index = 10 * k;
    keyframe.T_world_camera = odometry;
    walked.map.AddKeyframe(keyframe);
    if (k % 2 != 0) continue;
    const Eigen::Vector3d up = odometry.rotation * WalkedTo(k).rotation.conjugate() *
                               Eigen::Vector3d(noise(random), noise(random), 1);
    walked.imu.tilts.push_back({10 * k, 0.5 * k, up.normalized()});
  }
  return walked;
}

double MostTilt_deg(const std::map<int, Similarity>& keyframes) {
  double most = 0;
  for (const auto& [k, S] : keyframes) {
    const Eigen::Vector3d up = S.rotation * WalkedTo(k).rotation.conjugate() * Eigen::Vector3d::UnitZ();
    most = std::max(most, std::acos(std::min(1.0, up.z())) * internal::kDegrees);
  }
  return most;
}

TEST(Upright, AMapThatHasBentIsStraightened) {
  const WalkDone walked = WalkDownTheHall(0.06 * internal::kRadians, 0.3 * internal::kRadians);
  std::map<int, Similarity> bent;
  for (const PoseGraphNode& node : walked.graph.nodes()) bent[static_cast<int>(node.id)] = node.pose;
  ASSERT_GT(MostTilt_deg(bent), 6);
  const auto upright = Upright(walked.map, walked.imu, Similarity(), walked.graph);
  EXPECT_LT(MostTilt_deg(upright), 1);
  for (const auto& [k, S] : upright)
    EXPECT_LT((S.translation - WalkedTo(k).translation).norm(), 0.02 * (1 + 0.25 * k)) << k;
}

TEST(Upright, AMapThatIsStraightIsTurnedAsAWhole) {
  const WalkDone walked = WalkDownTheHall(0, 1 * internal::kRadians);
  const Similarity turn(2.5, ExpSO3({0.1, -0.2, 0}), Eigen::Vector3d::Zero());
  WalkDone lying = walked;  // in a frame of reference that this turn makes upright
  for (ImuTilt& tilt : lying.imu.tilts) tilt.up = turn.rotation.conjugate() * tilt.up;
  const auto upright = Upright(walked.map, lying.imu, turn, walked.graph);
  ASSERT_EQ(upright.size(), static_cast<std::size_t>(kKeyframes));
  for (const auto& [k, S] : upright) {
    const Similarity as_a_whole = turn * walked.graph.Node(k).pose;
    EXPECT_EQ(S.translation, as_a_whole.translation);
    EXPECT_EQ(S.scale, as_a_whole.scale);
  }
}

TEST(Upright, AFewWrongDirectionsBendNothing) {
  WalkDone walked = WalkDownTheHall(0, 0.3 * internal::kRadians);
  for (const std::size_t wrong : {7U, 20U, 21U, 40U})
    walked.imu.tilts[wrong].up = Eigen::Vector3d(0.6, 0, 0.8);
  const auto upright = Upright(walked.map, walked.imu, Similarity(), walked.graph);
  EXPECT_EQ(MostTilt_deg(upright), 0);
}

}  // namespace
}  // namespace tutti
