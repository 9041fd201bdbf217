#include "apps/slam/loop_constraint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "core/dense_solvers.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

constexpr int kLandmarks = 80;

PinholeCamera Camera() {
  PinholeCamera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 500;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

// Two keyframes that see the same landmarks, about 10 units away, each in its own frame; the query's map is
// `S.scale` times smaller. S maps points of the query's camera into the candidate's.
struct Views {
  KeyframeView candidate, query;
  explicit Views(const Similarity& S) {
    std::mt19937 generator(1);
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(generator() % 100000) / 1e5;
    };
    const PinholeCamera camera = Camera();
    candidate.id = 1;
    query.id = 50;
    for (KeyframeView* view : {&candidate, &query}) view->descriptors = cv::Mat(kLandmarks, 32, CV_8U);
    for (int i = 0; i < kLandmarks; ++i) {
      const double z = uniform(8, 12), y = uniform(-2, 2), x = uniform(-3, 3);
      const Eigen::Vector3d point(x, y, z);
      const Eigen::Vector3d in_query = S.Inverse() * point;
      Add(candidate, camera, point, i);
      Add(query, camera, in_query, i);
      for (int b = 0; b < 32; ++b) {
        candidate.descriptors.at<std::uint8_t>(i, b) = query.descriptors.at<std::uint8_t>(i, b) =
            static_cast<std::uint8_t>(generator());
      }
    }
  }
  static void Add(KeyframeView& view, const PinholeCamera& camera, const Eigen::Vector3d& point, int i) {
    const Eigen::Vector2d pixel = camera.Project(point);
    view.keypoints.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 31.0F);
    view.points.push_back(point);
    view.landmarks.push_back(i);
  }
};

CameraRig Rig(Sensor sensor) {
  CameraRig rig;
  rig.sensor = sensor;
  rig.camera = Camera();
  return rig;
}

LoopConstraint Mono(const Similarity& S) {
  const Views views(S);
  return MakeLoopConstraint(Verification(), views.candidate, views.query, Rig(Sensor::kMono),
                            LoopDetectorOptions());
}

TEST(LoopConstraint, MonoFindsPoseAndScaleFromTheLandmarksOfBothKeyframes) {
  const Similarity S(1.7, ExpSO3({0.02, -0.1, 0.03}), {0.6, -0.2, 1.1});
  const LoopConstraint found = Mono(S);
  ASSERT_TRUE(found.usable) << found.reason;
  EXPECT_EQ(found.edge.candidate, 1);
  EXPECT_EQ(found.edge.query, 50);
  EXPECT_NEAR(found.edge.S_candidate_query.scale, 1.7, 1e-4);
  EXPECT_LT((found.edge.S_candidate_query.translation - S.translation).norm(), 1e-3);
  EXPECT_LT(LogSO3(found.edge.S_candidate_query.rotation.conjugate() * S.rotation).norm(), 1e-4);
  EXPECT_NEAR(found.edge.depth, 10, 1);
  EXPECT_TRUE(internal::UpperCholesky(found.edge.information).positive_definite);
}

TEST(LoopConstraint, MonoViewsTooFarApartFixNoScale) {
  const LoopConstraint found = Mono(Similarity(1.0, Eigen::Quaterniond::Identity(), {0, 0, 7}));
  EXPECT_FALSE(found.usable);
  EXPECT_THAT(found.reason, HasSubstr("too far apart"));
}

TEST(LoopConstraint, KeyframesWithoutCommonLandmarksGiveNone) {
  Views views(Similarity(1.0, Eigen::Quaterniond::Identity(), {0, 0, 1}));
  views.query.points.assign(kLandmarks, Eigen::Vector3d::Constant(std::nan("")));
  const LoopConstraint found = MakeLoopConstraint(Verification(), views.candidate, views.query,
                                                  Rig(Sensor::kMono), LoopDetectorOptions());
  EXPECT_FALSE(found.usable);
  EXPECT_THAT(found.reason, HasSubstr("only 0 of its matches are landmarks"));
  views.candidate.points.assign(kLandmarks, Eigen::Vector3d::Constant(std::nan("")));
  EXPECT_FALSE(MakeLoopConstraint(Verification(), views.candidate, views.query, Rig(Sensor::kMono),
                                  LoopDetectorOptions())
                   .usable);
}

TEST(LoopConstraint, MetricSensorsTakeTheVerifiedTransform) {
  const Views views(Similarity(1.0, Eigen::Quaterniond::Identity(), {0, 0, 1}));
  Verification verification;
  verification.type = ConstraintType::kRigid;
  verification.S_candidate_query = Similarity(1.0, ExpSO3({0, 0.1, 0}), {0.1, 0.2, 0.3});
  verification.information = 1e4 * Matrix6d::Identity();
  const auto make = [&] {
    return MakeLoopConstraint(verification, views.candidate, views.query, Rig(Sensor::kRgbd),
                              LoopDetectorOptions());
  };
  const LoopConstraint found = make();
  ASSERT_TRUE(found.usable) << found.reason;
  EXPECT_EQ(found.edge.S_candidate_query.translation, verification.S_candidate_query.translation);
  // No surer than the options' floor: 1 % of a depth of 10.
  EXPECT_LT(found.edge.information(0, 0), 1 / (0.1 * 0.1));
}

TEST(LoopConstraint, MetricSensorsMeasureWhatWasVerifiedWithoutDepthByTheMapsLandmarks) {
  const Similarity S(1.0, ExpSO3({0.02, -0.1, 0.03}), {0.6, -0.2, 1.1});
  Views views(S);
  Verification verification;
  verification.type = ConstraintType::kEssential;
  verification.S_candidate_query = Similarity(1.0, S.rotation, S.translation.normalized());
  const auto make = [&] {
    return MakeLoopConstraint(verification, views.candidate, views.query, Rig(Sensor::kStereo),
                              LoopDetectorOptions());
  };
  const LoopConstraint found = make();
  ASSERT_TRUE(found.usable) << found.reason;
  EXPECT_LT((found.edge.S_candidate_query.translation - S.translation).norm(), 1e-3) << "in metres";
  EXPECT_EQ(found.edge.S_candidate_query.scale, 1);
  views.query.points.assign(kLandmarks, Eigen::Vector3d::Constant(std::nan("")));
  EXPECT_FALSE(make().usable);
  EXPECT_THAT(make().reason, HasSubstr("without depth"));
}

// A small motion of the one camera, and its mirror image of the other one, cost the same.
TEST(LoopConstraint, ALoopTurnedRoundSaysTheSame) {
  Verification found;
  found.candidate = 7;
  found.S_candidate_query = Similarity(1, ExpSO3({0.3, -0.2, 0.1}), {0.5, -1, 2});
  found.information.diagonal() << 400, 100, 25, 9e4, 4e4, 1e4;
  found.information(0, 4) = found.information(4, 0) = 1000;
  VerifiedMatch match;
  match.query = {1, 2};
  match.candidate = {3, 4};
  match.query_feature = 5;
  match.candidate_feature = 6;
  found.inlier_matches = {match};
  const Verification turned = Reversed(found, 12);
  EXPECT_EQ(turned.candidate, 12);
  EXPECT_EQ(turned.inlier_matches[0].query_feature, 6);
  EXPECT_EQ(turned.inlier_matches[0].candidate_feature, 5);
  EXPECT_EQ(turned.inlier_matches[0].query, match.candidate);
  const Similarity none = turned.S_candidate_query * found.S_candidate_query;
  EXPECT_LT(none.translation.norm() + LogSO3(none.rotation).norm(), 1e-12);
  const auto cost = [](const Verification& of, const Pose& T_candidate_query) {
    const Vector6d off = LogSE3(of.S_candidate_query.RigidPart().Inverse() * T_candidate_query);
    return off.dot(of.information * off);
  };
  Vector6d motion;
  motion << 1e-4, -2e-4, 3e-4, 1e-4, 2e-4, -1e-4;
  const Pose moved = found.S_candidate_query.RigidPart() * ExpSE3(motion);
  const double expected = cost(found, moved);
  EXPECT_NEAR(cost(turned, moved.Inverse()), expected, 1e-6 * expected);
}

}  // namespace
}  // namespace tutti
