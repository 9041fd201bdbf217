#include "tutti/backend/evaluation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

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

template <typename F>
std::string ErrorOf(F call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
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

TEST(Evaluation, AlignmentHasNoReflection) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  std::vector<Eigen::Vector3d> mirrored = points;
  for (Eigen::Vector3d& p : mirrored) p.x() = -p.x();
  EXPECT_NEAR(AlignPoints(points, mirrored, false).rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
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

// ---- figures that evo 1.36.5 prints for published trajectories (expected_evo.txt)
struct EvoCase {
  const char *name, *format, *reference, *estimate;
  TrajectoryAlignment alignment;
  double delta;  // 0: absolute error
  DeltaUnit unit;
  bool all_pairs, rotation;
  double max, mean, median, min, rmse, sse, std;
  double tolerance;  // of all but sse; sse: relative
};

class Evo : public ::testing::TestWithParam<EvoCase> {};

TEST_P(Evo, PrintsTheSameFigures) {
  const EvoCase& c = GetParam();
  TUTTI_REQUIRE_DATA(folder, "trajectories");
  const TrajectoryFormat format = ParseTrajectoryFormat(c.format);
  std::vector<std::string> warnings;
  const Trajectory reference = ReadTrajectory(folder / c.reference, format, &warnings);
  const Trajectory estimate = ReadTrajectory(folder / c.estimate, format, &warnings);
  EvaluationOptions options;
  options.alignment = c.alignment;
  options.by_index = format == TrajectoryFormat::kKitti;
  options.kitti = false;
  if (c.delta > 0) options.rpe_delta = c.delta;
  options.rpe_unit = c.unit;
  options.rpe_all_pairs = c.all_pairs;
  const EvaluationReport report = EvaluateTrajectory(reference, estimate, options);
  const ErrorStatistics& s = c.delta > 0 ? (c.rotation ? report.rpe_rotation : report.rpe)
                                         : (c.rotation ? report.ate_rotation : report.ate);
  EXPECT_NEAR(s.max, c.max, c.tolerance);
  EXPECT_NEAR(s.mean, c.mean, c.tolerance);
  EXPECT_NEAR(s.median, c.median, c.tolerance);
  EXPECT_NEAR(s.min, c.min, c.tolerance);
  EXPECT_NEAR(s.rmse, c.rmse, c.tolerance);
  EXPECT_NEAR(s.std, c.std, c.tolerance);
  EXPECT_NEAR(s.sse, c.sse, std::max(1e-6, 2 * c.tolerance * c.sse));
}

constexpr auto kNone = TrajectoryAlignment::kNone;
constexpr auto kOrigin = TrajectoryAlignment::kOrigin;
constexpr auto kSE3 = TrajectoryAlignment::kSE3;
constexpr auto kSim3 = TrajectoryAlignment::kSim3;
constexpr auto kFrames = DeltaUnit::kFrames;
constexpr auto kMetres = DeltaUnit::kMetres;
constexpr double kTol = 1e-6;
// clang-format off
const EvoCase kCases[] = {
  {"kitti_orb_se3", "kitti", "KITTI_00_gt.txt", "KITTI_00_ORB.txt", kSE3, 0, kFrames, false, false,
   3.587949, 1.156997, 1.065625, 0.069313, 1.303450, 7715.073440, 0.600282, kTol},
  {"kitti_orb_sim3", "kitti", "KITTI_00_gt.txt", "KITTI_00_ORB.txt", kSim3, 0, kFrames, false, false,
   2.693500, 0.872693, 0.844691, 0.179515, 0.937709, 3992.893611, 0.343083, kTol},
  {"kitti_sptam_none", "kitti", "KITTI_00_gt.txt", "KITTI_00_SPTAM.txt", kNone, 0, kFrames, false, false,
   14.911823, 8.623704, 8.282321, 0.000000, 9.224542, 386403.545160, 3.274738, kTol},
  {"kitti_sptam_se3", "kitti", "KITTI_00_gt.txt", "KITTI_00_SPTAM.txt", kSE3, 0, kFrames, false, false,
   7.768977, 3.490977, 3.642585, 0.694787, 3.738488, 63466.341223, 1.337675, kTol},
  // KITTI prints rotations with 6 digits; evo uses the matrices as they are, we the nearest rotations.
  {"kitti_orb_rpe_100m", "kitti", "KITTI_00_gt.txt", "KITTI_00_ORB.txt", kNone, 100, kMetres, false, false,
   2.292953, 1.000045, 0.895180, 0.275909, 1.102742, 42.561369, 0.464704, 4e-6},
  {"kitti_sptam_rpe_100m_deg", "kitti", "KITTI_00_gt.txt", "KITTI_00_SPTAM.txt", kNone, 100, kMetres, false, true,
   6.323592, 1.617416, 0.995381, 0.187020, 2.194739, 173.407722, 1.483525, kTol},
  {"fr2_orb_se3", "tum", "fr2_desk_groundtruth.txt", "fr2_desk_ORB.txt", kSE3, 0, kFrames, false, false,
   0.024300, 0.007492, 0.007415, 0.000350, 0.008119, 0.143305, 0.003129, kTol},
  {"fr2_orb_sim3", "tum", "fr2_desk_groundtruth.txt", "fr2_desk_ORB.txt", kSim3, 0, kFrames, false, false,
   0.021477, 0.005586, 0.005305, 0.000190, 0.006123, 0.081510, 0.002507, kTol},
  {"fr2_mono_sim3", "tum", "fr2_desk_groundtruth.txt", "fr2_desk_ORB_kf_mono.txt", kSim3, 0, kFrames, false, false,
   0.015689, 0.007104, 0.007100, 0.001216, 0.007729, 0.007050, 0.003046, kTol},
  {"fr2_orb_se3_deg", "tum", "fr2_desk_groundtruth.txt", "fr2_desk_ORB.txt", kSE3, 0, kFrames, false, true,
   2.024871, 0.959473, 0.949801, 0.132951, 0.989036, 2126.588394, 0.240006, kTol},
  {"fr2_orb_rpe_1f", "tum", "fr2_desk_groundtruth.txt", "fr2_desk_ORB.txt", kNone, 1, kFrames, false, false,
   0.019485, 0.003038, 0.002750, 0.000132, 0.003490, 0.026472, 0.001718, kTol},
  {"fr2_orb_rpe_1m_all", "tum", "fr2_desk_groundtruth.txt", "fr2_desk_ORB.txt", kNone, 1, kMetres, true, false,
   0.030902, 0.010701, 0.010379, 0.000329, 0.011673, 0.263374, 0.004664, kTol},
  {"fr1_rgbdslam_sim3", "tum", "freiburg1_xyz-groundtruth.txt", "freiburg1_xyz-rgbdslam_drift.txt", kSim3, 0, kFrames, false, false,
   0.034846, 0.011987, 0.011134, 0.000733, 0.013389, 0.140732, 0.005966, kTol},
  {"fr1_rgbdslam_origin", "tum", "freiburg1_xyz-groundtruth.txt", "freiburg1_xyz-rgbdslam_drift.txt", kOrigin, 0, kFrames, false, false,
   0.042177, 0.017349, 0.015866, 0.000000, 0.019368, 0.294468, 0.008610, kTol},
};
// clang-format on
INSTANTIATE_TEST_SUITE_P(Published, Evo, ::testing::ValuesIn(kCases),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace tutti
