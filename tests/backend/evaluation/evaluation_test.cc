#include "tutti/backend/evaluation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/error_of.h"

namespace tutti {
namespace {

using testing::ErrorOf;
using ::testing::HasSubstr;

Trajectory Curve(int n, double first_stamp = 100.0) {
  Trajectory out;
  for (int k = 0; k < n; ++k) {
    const double a = 0.05 * k;
    out.push_back({first_stamp + 0.1 * k,
                   Pose(ExpSO3({0.1 * std::sin(a), 0.2, a}), {5 * std::cos(a), 5 * std::sin(a), 0.3 * a})});
  }
  return out;
}

Trajectory Moved(const Trajectory& in, const Similarity& S) {
  Trajectory out = in;
  for (StampedPose& s : out) s.pose = ApplyAlignment(S, s.pose);
  return out;
}

TEST(Evaluation, AlignmentUndoesASimilarity) {
  const Trajectory reference = Curve(100);
  const Similarity S(2.5, ExpSO3({0.3, -2.0, 1.0}), {10, -20, 30});
  const Trajectory estimate = Moved(reference, S.Inverse());
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kSim3;
  const EvaluationReport report = EvaluateTrajectory(reference, estimate, options);
  EXPECT_EQ(report.pairs, 100u);
  EXPECT_LT(report.ate.max, 1e-9);
  EXPECT_LT(report.ate_rotation.max, 1e-6);
  EXPECT_LT(report.rpe.max, 1e-9);
  EXPECT_NEAR(report.S_reference_estimate.scale, 2.5, 1e-9);
}

TEST(Evaluation, RigidAlignmentLeavesTheScaleAlone) {
  const Trajectory reference = Curve(100);
  const EvaluationReport report =
      EvaluateTrajectory(reference, Moved(reference, Similarity(0.5, ExpSO3({1, 0, 0}), {1, 2, 3})));
  EXPECT_EQ(report.S_reference_estimate.scale, 1.0);
  EXPECT_GT(report.ate.rmse, 0.5);
}

TEST(Evaluation, OriginAlignmentPutsTheFirstPosesTogether) {
  const Trajectory reference = Curve(50);
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kOrigin;
  const Similarity S(1.0, ExpSO3({0.3, -2.0, 1.0}), {10, -20, 30});
  EXPECT_LT(EvaluateTrajectory(reference, Moved(reference, S), options).ate.max, 1e-9);
}

TEST(Evaluation, StatisticsOfKnownErrors) {
  const ErrorStatistics s = Summarize({4, 1, 3, 2});
  EXPECT_DOUBLE_EQ(s.mean, 2.5);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.sse, 30);
  EXPECT_DOUBLE_EQ(s.rmse, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(s.std, std::sqrt(1.25));
  EXPECT_DOUBLE_EQ(s.min, 1);
  EXPECT_DOUBLE_EQ(s.max, 4);
  EXPECT_EQ(Summarize({}).count, 0u);
}

TEST(Evaluation, AssociatesTheNearestStampsWithinTheLimit) {
  Trajectory reference = Curve(10), estimate;
  for (int k : {2, 5}) estimate.push_back({reference[static_cast<std::size_t>(k)].stamp_s + 0.004, Pose()});
  estimate.push_back({reference[7].stamp_s + 0.04, Pose()});
  const AssociatedPoses poses = AssociateByTime(reference, estimate, 0.01);
  EXPECT_EQ(poses.indices, (std::vector<std::pair<std::size_t, std::size_t>>{{2, 0}, {5, 1}}));
}

TEST(Evaluation, TrajectoriesOfDifferentTimesNameBothRanges) {
  const std::string error = ErrorOf([] { EvaluateTrajectory(Curve(10, 100), Curve(10, 5000)); });
  EXPECT_THAT(error, HasSubstr("100.000 .. 100.900 s"));
  EXPECT_THAT(error, HasSubstr("5000.000 .. 5000.900 s"));
}

TEST(Evaluation, TrajectoriesThatNearlyFitInTimeNameTheDistanceAndTheRemedy) {
  const std::string error = ErrorOf([] { EvaluateTrajectory(Curve(10, 100.013), Curve(10, 100)); });
  EXPECT_THAT(error, HasSubstr("the nearest are 0.013 s apart (pair them with --max-diff 0.014"));
  Trajectory sparse = Curve(100);
  for (std::size_t k = 2; k < sparse.size(); ++k) sparse[k].stamp_s += 0.013;
  EXPECT_THAT(ErrorOf([&] { EvaluateTrajectory(sparse, Curve(100)); }),
              HasSubstr("98 poses have no partner within 0.01 s (--max-diff"));
}

TEST(Evaluation, PosesWithoutAPartnerAreCounted) {
  Trajectory sparse;
  for (const StampedPose& pose : Curve(100)) {
    if (sparse.empty() || pose.stamp_s > sparse.back().stamp_s + 0.95) sparse.push_back(pose);
  }
  const EvaluationReport report = EvaluateTrajectory(sparse, Curve(120));
  EXPECT_EQ(report.pairs, 10u);
  EXPECT_EQ(report.coverage.share(), 1.0);
  EXPECT_EQ(report.coverage.unpaired, 91u - 10u);  // those after the reference are outside of it
}

TEST(Evaluation, OfPositionsAloneIsThatOfPositionsWithoutTheRest) {
  const Trajectory estimate = Curve(300);
  Trajectory reference = Moved(estimate, Similarity(1, ExpSO3({0.3, -2.0, 1.0}), {10, -20, 30}));
  for (std::size_t k = 0; k < reference.size(); ++k)
    reference[k].pose.translation.z() += 0.1 * std::sin(0.3 * static_cast<double>(k));
  Trajectory positions = reference;
  for (StampedPose& pose : positions) pose.pose.rotation = Eigen::Quaterniond(0, 0, 0, 0);
  const EvaluationReport with = EvaluateTrajectory(reference, estimate);
  for (const EvaluationReport& report :
       {EvaluateTrajectory(positions, estimate), EvaluateTrajectory(estimate, positions)}) {
    EXPECT_FALSE(report.rotations);
    EXPECT_NEAR(report.ate.rmse, with.ate.rmse, 1e-9);
    EXPECT_EQ(report.rpe_point_distance.count, with.rpe_point_distance.count);
    EXPECT_TRUE(std::isfinite(report.rpe_point_distance.rmse));
    for (const ErrorStatistics& s :
         {report.ate_rotation, report.ate_full, report.rpe, report.rpe_rotation, report.rpe_full})
      EXPECT_EQ(s.count, 0u);
    EXPECT_EQ(report.drift.segments, 0u);
  }
  EXPECT_NEAR(EvaluateTrajectory(positions, estimate).rpe_point_distance.rmse, with.rpe_point_distance.rmse,
              1e-12);
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kOrigin;
  EXPECT_THAT(ErrorOf([&] { EvaluateTrajectory(positions, estimate, options); }),
              HasSubstr("the reference has positions alone"));
  options.alignment = TrajectoryAlignment::kSE3;
  options.rpe_unit = DeltaUnit::kDegrees;
  EXPECT_THAT(ErrorOf([&] { EvaluateTrajectory(estimate, positions, options); }),
              HasSubstr("the estimate has positions alone"));
}

TEST(Evaluation, CountsMustAgreeWithoutStamps) {
  EvaluationOptions options;
  options.by_index = true;
  EXPECT_THAT(ErrorOf([&] { EvaluateTrajectory(Curve(10), Curve(9), options); }),
              HasSubstr("the reference has 10 poses and the estimate 9"));
}

TEST(Evaluation, OnePoseCanNotBeAlignedButCanBeCompared) {
  EXPECT_THAT(ErrorOf([] { EvaluateTrajectory(Curve(1), Curve(1)); }),
              HasSubstr("1 pair of poses is too few"));
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kNone;
  const EvaluationReport report = EvaluateTrajectory(Curve(1), Curve(1), options);
  EXPECT_EQ(report.ate.count, 1u);
  EXPECT_EQ(report.rpe.count, 0u);
}

TEST(Evaluation, PositionsOnALineOrInOnePlaceAreRefused) {
  Trajectory line, rest;
  for (int k = 0; k < 20; ++k) {
    line.push_back({0.1 * k, Pose(Eigen::Quaterniond::Identity(), {1.0 + 0.3 * k, 2.0 - 0.7 * k, 0.11 * k})});
    rest.push_back({0.1 * k, Pose()});
  }
  EXPECT_THAT(ErrorOf([&] { EvaluateTrajectory(line, line); }), HasSubstr("on a line or in one place"));
  EXPECT_THAT(ErrorOf([&] { EvaluateTrajectory(line, rest); }), HasSubstr("on a line or in one place"));
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kOrigin;
  EXPECT_LT(EvaluateTrajectory(line, line, options).ate.max, 1e-12);
}

TEST(Evaluation, EmptyTrajectoriesAreRefused) {
  EXPECT_THAT(ErrorOf([] { EvaluateTrajectory({}, Curve(3)); }), HasSubstr("the reference holds no pose"));
  EXPECT_THAT(ErrorOf([] { EvaluateTrajectory(Curve(3), {}); }), HasSubstr("the estimate holds no pose"));
}

TEST(Evaluation, KittiErrorsOfAKnownScaleError) {
  // An estimate that is 2 % too long along a straight road has 2 % translation error and no rotation error.
  std::vector<Pose> reference, estimate;
  for (int k = 0; k <= 1000; ++k) {
    reference.push_back(Pose(Eigen::Quaterniond::Identity(), {0, 0, 1.0 * k}));
    estimate.push_back(Pose(Eigen::Quaterniond::Identity(), {0, 0, 1.02 * k}));
  }
  const KittiErrors errors = EvaluateKitti(reference, estimate);
  EXPECT_GT(errors.segments, 400u);
  EXPECT_NEAR(errors.translation_percent, 2.0, 0.05);
  EXPECT_NEAR(errors.rotation_deg_per_m, 0.0, 1e-9);
  reference.resize(50);
  estimate.resize(50);
  EXPECT_EQ(EvaluateKitti(reference, estimate).segments, 0u);
}

TEST(Evaluation, KittiErrorsFollowTheDevelopmentKitForMatricesThatAreNotQuiteRotations) {
  // The kit's formula, written out: general inverses of 4x4 matrices, acos of the trace.
  std::vector<PoseMatrix> reference, estimate;
  for (int k = 0; k <= 400; ++k) {
    const double a = 0.01 * k;
    PoseMatrix r{ExpSO3({0.02 * a, a, 0.1}).toRotationMatrix(),
                 {100 * std::sin(a), 0.1 * k, 100 * std::cos(a)}};
    PoseMatrix e = r;
    r.rotation *= 1 + 1e-6 * (k % 7);
    e.rotation = e.rotation * ExpSO3({0, 0.001 * a, 0.002}).toRotationMatrix();
    e.translation *= 1.01;
    reference.push_back(r);
    estimate.push_back(e);
  }
  const auto matrix = [](const PoseMatrix& p) {
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
    m.topLeftCorner<3, 3>() = p.rotation;
    m.topRightCorner<3, 1>() = p.translation;
    return m;
  };
  std::vector<double> path = {0};
  for (std::size_t k = 1; k < reference.size(); ++k)
    path.push_back(path.back() + (reference[k].translation - reference[k - 1].translation).norm());
  double t = 0, r = 0;
  std::size_t n = 0;
  for (std::size_t first = 0; first < path.size(); first += 10) {
    for (double length = 100; length <= 800; length += 100) {
      std::size_t last = first;
      while (last < path.size() && path[last] <= path[first] + length) ++last;
      if (last == path.size()) continue;
      const Eigen::Matrix4d gt = matrix(reference[first]).inverse() * matrix(reference[last]);
      const Eigen::Matrix4d result = matrix(estimate[first]).inverse() * matrix(estimate[last]);
      const Eigen::Matrix4d error = result.inverse() * gt;
      t += error.topRightCorner<3, 1>().norm() / length;
      r += std::acos(std::clamp(0.5 * (error.topLeftCorner<3, 3>().trace() - 1), -1.0, 1.0)) / length;
      ++n;
    }
  }
  const KittiErrors errors = EvaluateKitti(reference, estimate);
  ASSERT_GT(n, 50u);
  EXPECT_EQ(errors.segments, n);
  EXPECT_NEAR(errors.translation_percent, 100 * t / static_cast<double>(n), 1e-9);
  EXPECT_NEAR(errors.rotation_deg_per_m, 180 / M_PI * r / static_cast<double>(n), 1e-12);
}

// Where the trace says that the cosine is more than one: matrices of files are rotations but for rounding.
TEST(Evaluation, KittiErrorsOfNoTurnAndOfHalfATurnAreNumbersInSpiteOfRounding) {
  std::vector<PoseMatrix> reference, no_turn, half_turn;
  for (int k = 0; k <= 150; ++k) {
    PoseMatrix pose{Eigen::Matrix3d::Identity(), {1.0 * k, 0, 0}};
    reference.push_back(pose);
    pose.rotation *= 1 - 1e-6 * k;
    no_turn.push_back(pose);
    if (k > 60) pose.rotation *= Eigen::Vector3d(-1, -1, 1).asDiagonal();
    half_turn.push_back(pose);
  }
  const KittiErrors none = EvaluateKitti(reference, no_turn);
  EXPECT_EQ(none.segments, 5u);  // of 100 m each
  EXPECT_EQ(none.rotation_deg_per_m, 0);
  EXPECT_NEAR(EvaluateKitti(reference, half_turn).rotation_deg_per_m, 180.0 / 100, 1e-12);
}

TEST(Evaluation, ScaleAloneLeavesRotationAndPositionWhereTheyAre) {
  const Trajectory reference = Curve(100);
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kScale;
  const Similarity half(0.5, Eigen::Quaterniond::Identity(), {0, 0, 0});
  const EvaluationReport report = EvaluateTrajectory(reference, Moved(reference, half), options);
  EXPECT_NEAR(report.S_reference_estimate.scale, 2.0, 1e-9);
  EXPECT_LT(report.ate.max, 1e-9);
  const Similarity turned(0.5, ExpSO3({0, 0, 1}), {1, 2, 3});
  const EvaluationReport off = EvaluateTrajectory(reference, Moved(reference, turned), options);
  EXPECT_NEAR(off.S_reference_estimate.scale, 2.0, 1e-9);
  EXPECT_GT(off.ate.rmse, 1.0);
}

TEST(Evaluation, YawAlignmentTurnsAboutTheVerticalAlone) {
  const Trajectory reference = Curve(100);
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kYaw;
  const Similarity yaw(1, ExpSO3({0, 0, 2.0}), {1, 2, 3});
  const EvaluationReport report = EvaluateTrajectory(reference, Moved(reference, yaw), options);
  EXPECT_LT(report.ate.max, 1e-9);
  EXPECT_LT(report.ate_rotation.max, 1e-6);
  const Similarity tilted(1, ExpSO3({0.2, 0, 2.0}), {1, 2, 3});
  const EvaluationReport off = EvaluateTrajectory(reference, Moved(reference, tilted), options);
  EXPECT_GT(off.ate.rmse, 0.1);
  const Eigen::Quaterniond& q = off.S_reference_estimate.rotation;
  EXPECT_NEAR(std::hypot(q.x(), q.y()), 0, 1e-12);
  // No other turn about the axis does better.
  AssociatedPoses poses = AssociateByIndex(reference, Moved(reference, tilted));
  const auto cost = [&](const Similarity& S) {
    double sum = 0;
    for (std::size_t k = 0; k < poses.reference.size(); ++k)
      sum += (poses.reference[k].translation - S * poses.estimate[k].translation).squaredNorm();
    return sum;
  };
  const Similarity best = AlignPoses(poses, options);
  for (const double turn : {-0.01, 0.01}) {
    Similarity other = best;
    other.rotation = ExpSO3({0, 0, turn}) * best.rotation;
    EXPECT_GT(cost(other), cost(best));
  }
  // Along the axis alone, the heading is not determined.
  Trajectory lift;
  for (int k = 0; k < 5; ++k)
    lift.push_back({1.0 * k, Pose(Eigen::Quaterniond::Identity(), {0, 0, 1.0 * k})});
  EXPECT_THAT(ErrorOf([&] { EvaluateTrajectory(lift, lift, options); }), HasSubstr("across the vertical"));
}

TEST(Evaluation, AlignmentOfTheFirstPosesAlone) {
  const Trajectory reference = Curve(100);
  Trajectory estimate = Moved(reference, Similarity(1, ExpSO3({0, 0, 1}), {4, 5, 6}));
  for (std::size_t k = 60; k < estimate.size(); ++k) estimate[k].pose.translation.x() += 3;
  EvaluationOptions options;
  options.align_first = 50;
  const EvaluationReport report = EvaluateTrajectory(reference, estimate, options);
  EXPECT_LT(report.ate.min, 1e-9);
  EXPECT_NEAR(report.ate.max, 3.0, 1e-9);
  options.align_first = 2;
  EXPECT_THAT(ErrorOf([&] { EvaluateTrajectory(reference, estimate, options); }), HasSubstr("too few"));
}

TEST(Evaluation, OffsetShiftsTheEstimateWhicheverIsLonger) {
  const Trajectory reference = Curve(100);
  Trajectory late(reference.begin() + 20, reference.begin() + 60);
  for (StampedPose& pose : late) pose.stamp_s += 3.25;
  EvaluationOptions options;
  options.time_offset_s = -3.25;
  EXPECT_LT(EvaluateTrajectory(reference, late, options).ate.max, 1e-9);
  options.time_offset_s = 3.25;
  EXPECT_LT(EvaluateTrajectory(late, reference, options).ate.max, 1e-9);
  EXPECT_EQ(EvaluateTrajectory(late, reference, options).pairs, 40u);
}

TEST(Evaluation, InterpolationFillsTheReferenceBetweenItsPoses) {
  Trajectory reference, estimate;
  for (int k = 0; k <= 10; ++k) {
    reference.push_back({1.0 * k, Pose(ExpSO3({0, 0, 0.1 * k}), {2.0 * k, 1.0 * (k % 2), 0})});
    estimate.push_back({k + 0.5, Pose(ExpSO3({0, 0, 0.1 * k + 0.05}), {2.0 * k + 1, 0.5, 0})});
  }
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kNone;
  options.interpolate = true;
  options.max_interpolation_s = 1.5;
  const EvaluationReport report = EvaluateTrajectory(reference, estimate, options);
  EXPECT_EQ(report.pairs, 10u);  // the last one lies beyond the reference
  EXPECT_LT(report.ate.max, 1e-12);
  EXPECT_LT(report.ate_rotation.max, 1e-6);
  options.max_interpolation_s = 0.5;
  EXPECT_THAT(ErrorOf([&] { EvaluateTrajectory(reference, estimate, options); }), HasSubstr("0.5 s apart"));
}

TEST(Evaluation, AFrameHasThePoseAtItsTimeOrTheNearestWithinHalfAFrame) {
  const double interval_s = 1.0 / 30;
  Trajectory reference;
  for (const double t : {1.0, 1.1, 1.2, 2.0})
    reference.push_back({t, Pose(Eigen::Quaterniond::Identity(), {t, 0, 0})});
  const auto x = [&](double stamp_s) {
    const std::optional<Pose> pose = PoseOfFrame(reference, stamp_s, interval_s);
    return pose ? pose->translation.x() : 0.0;
  };
  EXPECT_NEAR(x(1.07), 1.07, 1e-9) << "between two poses";
  EXPECT_EQ(x(0.99), 1.0) << "just before the first";
  EXPECT_EQ(x(0.98), 0.0);
  EXPECT_EQ(x(2.016), 2.0) << "just after the last";
  EXPECT_EQ(x(2.018), 0.0);
  EXPECT_EQ(x(1.21), 1.2) << "in a gap";
  EXPECT_EQ(x(1.6), 0.0);
  EXPECT_EQ(x(1.99), 2.0);
  EXPECT_FALSE(PoseOfFrame({}, 1.0, interval_s));
  EXPECT_FALSE(PoseOfFrame(reference, 0.999, 0)) << "a single frame has no interval";
  EXPECT_TRUE(PoseOfFrame(reference, 1.0, 0));
}

TEST(Evaluation, FullErrorIsTheNormOfBothParts) {
  const Trajectory reference = Curve(3);
  Trajectory estimate = reference;
  for (StampedPose& pose : estimate) pose.pose = pose.pose * Pose(ExpSO3({0.3, 0, 0}), {0, 0, 0.2});
  EvaluationOptions options;
  options.alignment = TrajectoryAlignment::kNone;
  const EvaluationReport report = EvaluateTrajectory(reference, estimate, options);
  const double rotation = 2 * std::sqrt(2.0) * std::sin(0.15);  // |R - I| of an angle
  EXPECT_NEAR(report.ate_full.mean, std::hypot(rotation, 0.2), 1e-9);
}

TEST(Evaluation, OptionsThatMakeNoSenseAreRefused) {
  EvaluationOptions options;
  options.rpe_delta = 1.5;
  EXPECT_THAT(options.Validate(), HasSubstr("whole number"));
  options.rpe_unit = DeltaUnit::kSeconds;
  options.by_index = true;
  EXPECT_THAT(options.Validate(), HasSubstr("needs time stamps"));
  options.by_index = false;
  options.vertical.setZero();
  EXPECT_THAT(options.Validate(), HasSubstr("vertical"));
  EXPECT_THAT(ErrorOf([] { ParseTrajectoryAlignment("se4"); }),
              HasSubstr("none, origin, se3, sim3, scale, yaw"));
  EXPECT_THAT(ErrorOf([] { ParseDeltaUnit("feet"); }), HasSubstr("degrees"));
}

}  // namespace
}  // namespace tutti
