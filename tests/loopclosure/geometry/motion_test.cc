// The motion between two views of a known one, by matches without noise.
#include "loopclosure/geometry/motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/loopclosure/geometry/two_poses.h"
#include "tests/support/plain_camera.h"

namespace tutti::internal {
namespace {

// An image of 640 px is taken to have this focal length where nobody knows its camera.
constexpr double kFocal = 0.8 * 640;

std::vector<PooledMatch> PoolOf(const testing::SeenTwice& seen, const cv::Point2f& query_at = {},
                                const cv::Point2f& candidate_at = {}) {
  std::vector<PooledMatch> pool;
  for (std::size_t i = 0; i < seen.first.size(); ++i) {
    PooledMatch match;
    match.candidate = seen.first[i] + candidate_at;
    match.query = seen.second[i] + query_at;
    match.query_point = match.candidate_point =
        Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
    pool.push_back(match);
  }
  return pool;
}

View ViewOf(bool calibrated) {
  View view;
  view.size = {640, 480};
  if (calibrated) view.camera = testing::PlainCamera(kFocal);
  return view;
}

Motion MotionOf(const Pose& T_candidate_query, bool calibrated, bool flat,
                const VerificationOptions& options = {}) {
  const PinholeCamera camera = testing::PlainCamera(kFocal);
  const testing::SeenTwice seen = testing::SeeTwice(camera, camera, T_candidate_query.Inverse(), flat);
  return FitMotion(PoolOf(seen), ViewOf(calibrated), ViewOf(calibrated), options, 1);
}

TEST(FitMotion, IsTheDirectionFromTheCandidateToTheQuery) {
  const Pose T_candidate_query(ExpSO3({0.02, -0.06, 0.03}), {0.6, 0.1, 0.5});
  const Eigen::Vector3d direction = T_candidate_query.translation.normalized();
  for (const bool calibrated : {true, false}) {
    const Motion motion = MotionOf(T_candidate_query, calibrated, false);
    EXPECT_EQ(motion.type, calibrated ? ConstraintType::kEssential : ConstraintType::kFundamental);
    EXPECT_FALSE(motion.homography);
    EXPECT_EQ(motion.considered, 120);
    EXPECT_GE(motion.inliers.size(), 119u);
    EXPECT_EQ(motion.fewest, -1);
    if (!calibrated) continue;
    EXPECT_LT((motion.T_candidate_query.translation - direction).norm(), 5e-3);
    EXPECT_LT(LogSO3(motion.T_candidate_query.rotation.conjugate() * T_candidate_query.rotation).norm(),
              2e-3);
  }
}

TEST(FitMotion, OfAFlatSceneHasNoDirection) {
  for (const bool calibrated : {true, false}) {
    const Motion motion = MotionOf(Pose(ExpSO3({0.02, -0.06, 0.03}), {0.6, 0.1, 0.5}), calibrated, true);
    EXPECT_TRUE(motion.homography);
    EXPECT_EQ(motion.inliers.size(), 120u);
  }
  VerificationOptions without;
  without.homography_px = 0;
  EXPECT_FALSE(MotionOf(Pose(ExpSO3({0.02, -0.06, 0.03}), {0.6, 0.1, 0.5}), true, true, without).homography);
}

TEST(FitMotion, OfACameraThatTurnedIsARotation) {
  const Pose T_candidate_query(ExpSO3({0.05, -0.2, 0.1}), {0, 0, 0});
  const Motion motion = MotionOf(T_candidate_query, true, false);
  EXPECT_TRUE(motion.homography);
  EXPECT_EQ(motion.T_candidate_query.translation.norm(), 0);
  EXPECT_LT(LogSO3(motion.T_candidate_query.rotation.conjugate() * T_candidate_query.rotation).norm(), 1e-4);
}

TEST(FitMotion, ChanceIsThatOfTheModelAndTheImage) {
  const VerificationOptions options;
  for (const bool calibrated : {true, false}) {
    const Motion motion = MotionOf(Pose(ExpSO3({0, 0, 0}), {0.6, 0.1, 0.5}), calibrated, false);
    const ChanceFit expected =
        FitByChance(calibrated ? FitModel::kEssential : FitModel::kFundamental, 120,
                    static_cast<int>(motion.inliers.size()), options.epipolar_px, cv::Size(640, 480));
    EXPECT_EQ(motion.chance.expected, expected.expected);
    EXPECT_EQ(motion.chance.log_nfa, expected.log_nfa);
  }
}

// Two images side by side. `seen` of the left and of the right one; opposite: a drive the other way.
class TwoCameras {
 public:
  TwoCameras(std::size_t left, std::size_t right, bool opposite) {
    const PinholeCamera camera = testing::PlainCamera(kFocal);
    for (View* view : {&query_, &candidate_}) {
      view->size = {1280, 480};
      view->cameras = {cv::Rect(0, 0, 640, 480), cv::Rect(640, 0, 640, 480)};
      view->members.emplace_back();
    }
    for (const bool is_right : {false, true}) {
      testing::SeenTwice seen = testing::SeeTwice(
          camera, camera, Pose(ExpSO3({0, 0.02, 0}), {0.2, 0.1, -0.9}), false, is_right ? 5 : 3);
      seen.first.resize(is_right ? right : left);
      seen.second.resize(is_right ? right : left);
      const cv::Point2f of_right(640, 0), of_left(0, 0);
      const cv::Point2f in_candidate = is_right ? of_right : of_left;
      const cv::Point2f in_query = is_right != opposite ? of_right : of_left;
      for (const PooledMatch& match : PoolOf(seen, in_query, in_candidate)) {
        pool_.push_back(match);
        query_.members[0].pixels.push_back(match.query);
        candidate_.members[0].pixels.push_back(match.candidate);
      }
    }
  }

  // Features that match nothing, in the right image of both.
  void AddFeatures(int count) {
    for (int i = 0; i < count; ++i) {
      query_.members[0].pixels.emplace_back(700.0f + static_cast<float>(i), 100.0f);
      candidate_.members[0].pixels.emplace_back(900.0f, 10.0f + static_cast<float>(i));
    }
  }

  Motion Fit() const { return FitMotion(pool_, query_, candidate_, {}, 1); }

 private:
  View query_, candidate_;
  std::vector<PooledMatch> pool_;
};

TEST(FitMotion, CamerasAreFittedEachWithItsLikeOrWithItsOpposite) {
  for (const bool opposite : {false, true}) {
    const Motion motion = TwoCameras(100, 80, opposite).Fit();
    EXPECT_GE(motion.inliers.size(), 178u) << opposite;
    EXPECT_TRUE(std::is_sorted(motion.inliers.begin(), motion.inliers.end()));
    EXPECT_EQ(motion.considered, 180);
    EXPECT_NEAR(motion.fewest, 80, 2);
    const VerificationOptions options;
    double expected = 0, log_nfa = 0;
    for (const int matches : {100, 80}) {
      const ChanceFit one =
          FitByChance(FitModel::kFundamental, matches, matches, options.epipolar_px, cv::Size(640, 480));
      expected += one.expected;
      log_nfa += one.log_nfa;
    }
    EXPECT_NEAR(motion.chance.expected, expected, 1e-9);
    EXPECT_NEAR(motion.chance.log_nfa, log_nfa, 15);
  }
}

TEST(FitMotion, OfACameraThatSeesLittleNothingNeedBeFoundAgain) {
  TwoCameras few(100, 20, false);
  few.AddFeatures(39);
  EXPECT_NEAR(few.Fit().fewest, 100, 2) << "59 features";
  TwoCameras many(100, 20, false);
  many.AddFeatures(40);
  EXPECT_NEAR(many.Fit().fewest, 20, 2) << "60 features";
}

}  // namespace
}  // namespace tutti::internal
