// Downsampling, motion filter, projection, point distances: known answers, with evo's definitions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/numbers.h"
#include "tests/support/error_of.h"
#include "tutti/backend/evaluation.h"

namespace tutti {
namespace {

using ::testing::ElementsAre;
using testing::ErrorOf;
using ::testing::HasSubstr;
using Indices = std::vector<std::size_t>;

// 1 m a second along x.
Trajectory Line(int n) {
  Trajectory out;
  for (int k = 0; k < n; ++k) out.push_back({1.0 * k, Pose(Eigen::Quaterniond::Identity(), {1.0 * k, 0, 0})});
  return out;
}

TEST(EvaluationFilter, EvenlySpacedPosesAreThoseOfNumpysLinspace) {
  // numpy.linspace(0, 9, 4, dtype=int), (0, 9, 3), (0, 9, 1), (0, 1692, 7)
  EXPECT_THAT(EvenlySpacedPoses(10, 4), ElementsAre(0, 3, 6, 9));
  EXPECT_THAT(EvenlySpacedPoses(10, 3), ElementsAre(0, 4, 9));
  EXPECT_THAT(EvenlySpacedPoses(10, 1), ElementsAre(0));
  EXPECT_THAT(EvenlySpacedPoses(1693, 7), ElementsAre(0, 282, 564, 846, 1128, 1410, 1692));
  EXPECT_EQ(EvenlySpacedPoses(5, 5).size(), 5u);
  EXPECT_EQ(EvenlySpacedPoses(5, 50).size(), 5u);
  EXPECT_TRUE(EvenlySpacedPoses(0, 3).empty());
}

TEST(EvaluationFilter, APoseCountsAfterThePathOrTheTurn) {
  EXPECT_THAT(MovedPoses(Line(10), {3, 90}), ElementsAre(0, 3, 6, 9));
  Trajectory turning = Line(10);  // 20 degrees a pose; 3 m are never reached before 40 degrees
  for (int k = 0; k < 10; ++k)
    turning[static_cast<std::size_t>(k)].pose.rotation = ExpSO3({0, 0, 20.0 * k * internal::kRadians});
  EXPECT_THAT(MovedPoses(turning, {3, 39.9}), ElementsAre(0, 2, 4, 6, 8));
  EXPECT_EQ(MovedPoses(Line(10), {0, 90}).size(), 10u);
  EXPECT_TRUE(MovedPoses({}, {1, 1}).empty());
}

TEST(EvaluationFilter, ThePathCountsNotTheDistance) {
  Trajectory back_and_forth = Line(9);  // 0 1 0 1 ...: never 2 m away
  for (std::size_t k = 0; k < 9; ++k) back_and_forth[k].pose.translation.x() = k % 2 == 0 ? 0 : 1;
  EXPECT_THAT(MovedPoses(back_and_forth, {4, 90}), ElementsAre(0, 4, 8));
}

TEST(EvaluationFilter, AnglesAreRollPitchYaw) {
  const Eigen::Matrix3d R =
      (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(-0.5, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(2.1, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  EXPECT_LT((RollPitchYaw(R) - Eigen::Vector3d(2.1, -0.5, 0.3)).norm(), 1e-12);
  const Eigen::Matrix3d up = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitY()).toRotationMatrix();
  EXPECT_NEAR(RollPitchYaw(up).y(), M_PI / 2, 1e-7);
}

TEST(EvaluationFilter, AProjectedPoseKeepsTheTurnAboutTheNormal) {
  PoseMatrix pose;
  pose.translation = {1, 2, 3};
  pose.rotation =
      (Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  const PoseMatrix xy = ProjectToPlane(pose, ProjectionPlane::kXY);
  EXPECT_EQ(xy.translation, Eigen::Vector3d(1, 2, 0));
  EXPECT_LT((xy.rotation - Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()).toRotationMatrix()).norm(),
            1e-12);
  EXPECT_EQ(ProjectToPlane(pose, ProjectionPlane::kXZ).translation, Eigen::Vector3d(1, 0, 3));
  const PoseMatrix yz = ProjectToPlane(pose, ProjectionPlane::kYZ);
  EXPECT_EQ(yz.translation, Eigen::Vector3d(0, 2, 3));
  EXPECT_LT((yz.rotation - Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX()).toRotationMatrix()).norm(),
            1e-12);
}

TEST(EvaluationFilter, InThePlaneAnErrorAlongTheNormalVanishes) {
  Trajectory reference = Line(50), estimate = Line(50);
  for (std::size_t k = 0; k < 50; ++k)
    estimate[k].pose.translation += Eigen::Vector3d(0, 0.5, k % 2 ? 3 : -1);
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kNone;
  EXPECT_GT(EvaluateTrajectory(reference, estimate, options).ate.max, 3);
  options.plane = ProjectionPlane::kXY;
  const EvaluationReport report = EvaluateTrajectory(reference, estimate, options);
  EXPECT_DOUBLE_EQ(report.ate.min, 0.5);
  EXPECT_DOUBLE_EQ(report.ate.max, 0.5);
  EXPECT_NEAR(report.rpe.max, 0, 1e-12);
  EXPECT_EQ(report.poses.estimate[1].translation.z(), 0);
}

TEST(EvaluationFilter, FiltersComeBeforeTheAssociation) {
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kNone;
  options.downsample = 11;
  EXPECT_EQ(EvaluateTrajectory(Line(101), Line(101), options).pairs, 11u);
  options.downsample = 0;
  options.motion_filter = MotionFilter{5, 10};
  const EvaluationReport report = EvaluateTrajectory(Line(101), Line(101), options);
  EXPECT_EQ(report.pairs, 21u);
  EXPECT_EQ(report.reference_poses, 21u);
  EXPECT_EQ(report.coverage.all, 101u) << "the coverage is that of the files";
  options.by_index = true;
  EXPECT_THAT(ErrorOf([&] { EvaluateTrajectory(Line(101), Line(101), options); }), HasSubstr("time stamps"));
  options.motion_filter = MotionFilter{-1, 0};
  EXPECT_THAT(options.Validate(), HasSubstr("motion_filter"));
}

TEST(EvaluationFilter, PointDistanceSeesLengthsAlone) {
  Trajectory reference = Line(10), estimate = Line(10);
  for (std::size_t k = 0; k < 10; ++k)  // turned by a right angle, a tenth longer
    estimate[k].pose =
        Pose(ExpSO3({0, 0, 1.0 * static_cast<double>(k)}), {0, 1.1 * static_cast<double>(k), 0});
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kNone;
  options.rpe_delta = 3;
  const EvaluationReport report = EvaluateTrajectory(reference, estimate, options);
  EXPECT_EQ(report.rpe_point_distance.count, 3u);
  EXPECT_NEAR(report.rpe_point_distance.min, 0.3, 1e-12);
  EXPECT_NEAR(report.rpe_point_distance.max, 0.3, 1e-12);
  EXPECT_NEAR(report.rpe_point_distance_ratio.mean, 10, 1e-10);
  EXPECT_GT(report.rpe.min, 1);
  for (StampedPose& pose : reference) pose.pose.translation.setZero();
  const EvaluationReport still = EvaluateTrajectory(reference, estimate, options);
  EXPECT_EQ(still.rpe_point_distance_ratio.count, 0u) << "nothing is divided by nothing";
}

TEST(EvaluationFilter, StatisticsOfTheAssociation) {
  const Trajectory reference = Line(10);
  Trajectory estimate;  // 4 of 6 near a pose, 1 to 4 ms late
  for (int k = 0; k < 4; ++k) estimate.push_back({k + 0.001 * (k + 1), Pose()});
  estimate.push_back({5.5, Pose()});
  estimate.push_back({20, Pose()});
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kNone;
  const EvaluationReport report = EvaluateTrajectory(reference, estimate, options);
  EXPECT_EQ(report.pairs, 4u);
  EXPECT_EQ(report.association.reference_unmatched, 6u);
  EXPECT_EQ(report.association.estimate_unmatched, 2u);
  EXPECT_NEAR(report.association.median_time_difference_s, 0.0025, 1e-9);
  EXPECT_NEAR(report.association.largest_time_difference_s, 0.004, 1e-9);
}

}  // namespace
}  // namespace tutti
