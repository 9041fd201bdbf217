// The bars of the verifier, and what it makes of points without a common scale: exact matches, in known
// numbers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core/dense_solvers.h"
#include "loopclosure/geometry/verification.h"
#include "tests/loopclosure/geometry/append_rows.h"
#include "tests/support/plain_camera.h"
#include "tutti/loopclosure/relative_pose.h"

namespace tutti {
namespace {

const Pose kCandidateQuery(ExpSO3({0.02, -0.05, 0.03}), {0.5, -0.1, 0.3});
constexpr double kUnits = 0.4;  // of the candidate's points, of 1 of the query's

// Two views of points that are added one by one; each has descriptors that nothing else has.
class TwoViews {
 public:
  TwoViews() {
    for (View* view : {&query_, &candidate_}) {
      view->size = {640, 480};
      view->camera = testing::PlainCamera(500);
      view->members.emplace_back();
    }
    query_.id = 9;
    candidate_.id = 1;
  }

  // Matches of the motion; without points those of the candidate are unknown, of the query always.
  TwoViews& AddTrue(int count, bool with_points) {
    for (int i = 0; i < count; ++i) {
      Eigen::Vector3d p, q;
      Eigen::Vector2d a, b;
      do {
        p = {Between(-3, 3), Between(-2, 2), Between(4, 12)};
        q = kCandidateQuery.Inverse() * p;
        a = candidate_.camera->Project(p);
        b = query_.camera->Project(q);
      } while (!candidate_.camera->Contains(a) || !query_.camera->Contains(b) || !IsAlone(a, b));
      AddMatch(a, b, with_points ? p : Nowhere(), Nowhere());
      true_points_.push_back(p);
    }
    return *this;
  }
  // Matches of nothing.
  TwoViews& AddFalse(int count, bool with_points) {
    for (int i = 0; i < count; ++i) {
      Eigen::Vector2d a, b;
      do {
        a = {Between(0, 640), Between(0, 480)};  // in braces: drawn in this order by every compiler
        b = {Between(0, 640), Between(0, 480)};
      } while (!IsAlone(a, b));
      AddMatch(a, b,
               with_points ? Eigen::Vector3d(Between(5, 6) * candidate_.camera->Unproject(a)) : Nowhere(),
               Nowhere());
    }
    return *this;
  }

  // Nobody knows a metre: both have points of their own unit, of the first `count` matches.
  TwoViews& WithoutScale(int count, bool consistent) {
    query_.metric = candidate_.metric = false;
    for (int i = 0; i < count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double error = consistent ? 1 : 0.2 * std::pow(1.2, i);
      candidate_.members[0].points[k] = (kUnits * true_points_[k]).cast<float>();
      query_.members[0].points[k] = (error * (kCandidateQuery.Inverse() * true_points_[k])).cast<float>();
    }
    return *this;
  }

  Verification Verify(const VerificationOptions& options = {}) const {
    return GeometricVerifier(options, 1).Verify(query_, candidate_);
  }
  const View& query() const { return query_; }
  const View& candidate() const { return candidate_; }

 private:
  double Between(double low, double high) { return low + (high - low) * (random_() % 1000000u) / 1e6; }
  static Eigen::Vector3d Nowhere() {
    return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  // The verifier counts one of the matches in the same 4 x 4 px of an image.
  bool IsAlone(const Eigen::Vector2d& in_candidate, const Eigen::Vector2d& in_query) const {
    const auto far = [](const View& view, const Eigen::Vector2d& pixel) {
      const std::vector<cv::Point2f>& others = view.members[0].pixels;
      return std::none_of(others.begin(), others.end(), [&](const cv::Point2f& other) {
        return (Eigen::Vector2d(other.x, other.y) - pixel).norm() < 6;
      });
    };
    return far(candidate_, in_candidate) && far(query_, in_query);
  }
  void AddMatch(const Eigen::Vector2d& in_candidate, const Eigen::Vector2d& in_query,
                const Eigen::Vector3d& candidate_point, const Eigen::Vector3d& query_point) {
    cv::Mat descriptor(1, 32, CV_8U);
    for (int c = 0; c < 32; ++c) descriptor.at<std::uint8_t>(0, c) = static_cast<std::uint8_t>(random_());
    const auto add = [&](View::Set& set, const Eigen::Vector2d& pixel, const Eigen::Vector3d& point) {
      set.pixels.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
      set.points.push_back(point.cast<float>());
      testing::AppendRows(descriptor, &set.descriptors);
    };
    add(candidate_.members[0], in_candidate, candidate_point);
    add(query_.members[0], in_query, query_point);
  }

  std::mt19937 random_{4};
  View query_, candidate_;
  std::vector<Eigen::Vector3d> true_points_;  // in the candidate's camera
};

TEST(VerifierBars, WithPointsThirtyMustFitOnePose) {
  for (const int inliers : {29, 30}) {
    const Verification v = TwoViews().AddTrue(inliers, true).AddFalse(20, true).Verify();
    EXPECT_EQ(v.type, ConstraintType::kRigid);
    EXPECT_EQ(v.inliers, inliers);
    EXPECT_EQ(v.matches, inliers + 20);
    EXPECT_EQ(v.accepted, inliers == 30) << v.reason;
    EXPECT_LT(LogSE3(v.S_candidate_query.RigidPart().Inverse() * kCandidateQuery).norm(), 1e-3);
  }
}

TEST(VerifierBars, WithPointsThreeTenthsMustFitOnePose) {
  VerificationOptions options;
  options.match_ratio = 0.99;
  EXPECT_TRUE(TwoViews().AddTrue(40, true).AddFalse(92, true).Verify(options).accepted);
  const Verification v = TwoViews().AddTrue(40, true).AddFalse(96, true).Verify(options);
  EXPECT_FALSE(v.accepted);
  EXPECT_NE(v.reason.find("29 %"), std::string::npos) << v.reason;
}

TEST(VerifierBars, MatchesWithoutAPointDoNotCountForThePose) {
  const Verification v = TwoViews().AddTrue(40, true).AddFalse(100, false).Verify();
  EXPECT_EQ(v.type, ConstraintType::kRigid);
  EXPECT_EQ(v.matches, 40);
  EXPECT_TRUE(v.accepted) << v.reason;
}

TEST(VerifierBars, TwelveShowAPlaceAndTwentyThatAllFitAMotion) {
  for (const int inliers : {11, 12, 19, 21}) {
    const Verification v = TwoViews().AddTrue(inliers, false).Verify();
    EXPECT_EQ(v.similar, inliers >= 12) << inliers;
    EXPECT_EQ(v.accepted, inliers >= 20) << inliers << ": " << v.reason;
  }
}

TEST(VerifierBars, AFewOfManyShowAPlaceButNoMotionAndThirtyDo) {
  const Verification few = TwoViews().AddTrue(22, false).AddFalse(60, false).Verify();
  EXPECT_TRUE(few.similar);
  EXPECT_FALSE(few.accepted);
  EXPECT_NE(few.reason.find("30 are needed"), std::string::npos) << few.reason;
  EXPECT_TRUE(TwoViews().AddTrue(40, false).AddFalse(200, false).Verify().accepted) << "whatever their share";
}

// Something else decides about fewer than thirty points.
TEST(VerifierBars, TooFewPointsLeaveItToThePixels) {
  EXPECT_EQ(TwoViews().AddTrue(29, true).AddTrue(40, false).Verify().type, ConstraintType::kEssential);
  EXPECT_EQ(TwoViews().AddTrue(30, true).AddTrue(40, false).Verify().type, ConstraintType::kRigid);
}

TEST(VerifierBars, FewerMatchesThanInliersAreNeededAreNotTried) {
  EXPECT_NE(TwoViews().AddTrue(11, false).Verify().reason.find("only 11 features match"), std::string::npos);
  EXPECT_TRUE(TwoViews().AddTrue(30, false).Verify().accepted);
}

TEST(VerifierBars, MatchesMustSpreadOverBothImages) {
  VerificationOptions options;
  const TwoViews views = TwoViews().AddTrue(40, true);
  for (const double least : {0.1, 0.28}) {
    options.min_spread = least;
    EXPECT_EQ(views.Verify(options).accepted, least < 0.2) << least;
  }
}

TEST(VerifierWithoutScale, FindsTheScaleOfTheCandidatesPointsOverTheQuerys) {
  const TwoViews views = TwoViews().AddTrue(60, false).WithoutScale(50, true);
  const Verification v = views.Verify();
  ASSERT_TRUE(v.accepted) << v.reason;
  ASSERT_EQ(v.type, ConstraintType::kSimilarity);
  EXPECT_NEAR(v.S_candidate_query.scale, kUnits, 1e-3);
  EXPECT_LT((v.S_candidate_query.translation - kUnits * kCandidateQuery.translation).norm(), 1e-3);

  // What is known of the pose, whatever the scale: its part of the covariance, inverted.
  std::vector<Eigen::Vector3d> points_c, points_q;
  std::vector<Eigen::Vector2d> pixels_c, pixels_q;
  for (std::size_t i = 0; i < 50; ++i) {
    const View::Set &c = views.candidate().members[0], &q = views.query().members[0];
    points_c.push_back(c.points[i].cast<double>());
    points_q.push_back(q.points[i].cast<double>());
    pixels_c.emplace_back(c.pixels[i].x, c.pixels[i].y);
    pixels_q.emplace_back(q.pixels[i].x, q.pixels[i].y);
  }
  RelativePoseOptions options;
  options.threshold_px = 2 * VerificationOptions().reprojection_px;
  const SimilarityResult fit = SolveSimilarity(points_c, pixels_c, *views.candidate().camera, points_q,
                                               pixels_q, *views.query().camera, options);
  ASSERT_EQ(fit.inliers.size(), 50u);
  const Matrix6d covariance = internal::Inverse(fit.information).topLeftCorner<6, 6>();
  const Matrix6d expected = internal::Inverse(covariance);
  EXPECT_LT((v.information - expected).norm(), 1e-2 * expected.norm());
}

// The gate of SLAM asks for a similarity itself, of landmarks that more images have seen by then.
TEST(VerifierWithoutScale, PointsThatDoNotFitAreNoVeto) {
  EXPECT_EQ(TwoViews().AddTrue(60, false).WithoutScale(11, true).Verify().type, ConstraintType::kEssential);
  EXPECT_EQ(TwoViews().AddTrue(60, false).WithoutScale(12, true).Verify().type, ConstraintType::kSimilarity);
  const Verification wrong = TwoViews().AddTrue(60, false).WithoutScale(40, false).Verify();
  EXPECT_TRUE(wrong.accepted) << wrong.reason;
  EXPECT_EQ(wrong.type, ConstraintType::kEssential);
  EXPECT_EQ(wrong.inliers, 60);
}

}  // namespace
}  // namespace tutti
