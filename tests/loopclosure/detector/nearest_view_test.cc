#include "loopclosure/detector/hypothesis_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti::internal {
namespace {

constexpr int kPathViews = 40;
constexpr int kPathStart = 20;
const cv::Size kPathImage(640, 480);
constexpr double kPathFocal = 500;  // [px]

Pose LooksFrom(const Eigen::Vector3d& position, double yaw_deg = 0) {
  const Eigen::AngleAxisd turn(yaw_deg * M_PI / 180, Eigen::Vector3d::UnitY());
  return {Eigen::Quaterniond(turn), position};
}

// A path of views in a cloud of points, which are seen from 5 to 30 m away. Geometry accepts what shares 40
// points.
class NearestViewTest : public ::testing::Test {
 protected:
  NearestViewTest() : memory_(1), views_(kPathViews) {
    std::mt19937 random(3);
    const auto between = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
    };
    for (int i = 0; i < 3000; ++i) points_.emplace_back(between(-15, 15), between(-8, 8), between(3, 70));
    query_.id = 1000;
    query_.size = kPathImage;
    for (int i = 0; i < kPathViews; ++i) {
      views_[static_cast<std::size_t>(i)].id = i;
      views_[static_cast<std::size_t>(i)].size = kPathImage;
      memory_.Add(i);
      memory_.Settle();
    }
    Along({0, 0, 1});
  }

  // View i stands i steps from the origin.
  void Along(const Eigen::Vector3d& step) {
    path_.clear();
    for (int i = 0; i < kPathViews; ++i) path_.push_back(LooksFrom(i * step));
  }

  static cv::Point2f Pixel(const Eigen::Vector3d& in_camera) {
    return {static_cast<float>(kPathFocal * in_camera.x() / in_camera.z() + 0.5 * kPathImage.width),
            static_cast<float>(kPathFocal * in_camera.y() / in_camera.z() + 0.5 * kPathImage.height)};
  }

  Verification Verify(const Pose& T_world_query, int id) const {
    const Pose T_query_world = T_world_query.Inverse();
    const Pose T_candidate_world = path_[static_cast<std::size_t>(id)].Inverse();
    const cv::Rect2f image(0, 0, static_cast<float>(kPathImage.width), static_cast<float>(kPathImage.height));
    Verification verification;
    verification.candidate = id;
    for (const Eigen::Vector3d& point : points_) {
      const Eigen::Vector3d q = T_query_world * point;
      const Eigen::Vector3d c = T_candidate_world * point;
      if (q.z() < 5 || c.z() < 3 || q.z() > 30 || !image.contains(Pixel(q)) || !image.contains(Pixel(c)))
        continue;
      verification.inlier_matches.push_back({Pixel(q), Pixel(c), -1, -1});
    }
    verification.inliers = static_cast<int>(verification.inlier_matches.size());
    if (more_.count(id) > 0) verification.inliers = more_.at(id);
    verification.similar = verification.accepted = verification.inliers >= 40 && refused_.count(id) == 0;
    return verification;
  }

  int Nearest(const Pose& T_world_query, int start = kPathStart) {
    looked_at_.clear();
    const int slot = FindNearestView(
        query_, start, memory_, [&](int i) -> const View& { return views_[static_cast<std::size_t>(i)]; },
        [&](int i) -> const Verification& {
          return looked_at_.try_emplace(i, Verify(T_world_query, i)).first->second;
        });
    return slot;
  }

  LocationMemory memory_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<Pose> path_;  // T_world_camera of each view
  std::vector<View> views_;
  View query_;
  std::map<int, int> more_;  // inliers that a view is said to have
  std::set<int> refused_;    // by geometry
  std::map<int, Verification> looked_at_;
};

TEST_F(NearestViewTest, OfARoadIsFoundFromBeforeItAndFromBehind) {
  for (const int start : {15, 18, 19, 20, 21, 22, 25}) {
    EXPECT_EQ(Nearest(LooksFrom({0.4, 0.1, 20.2}), start), 20) << start;
    EXPECT_LE(looked_at_.size(), 5U) << start;
  }
}

TEST_F(NearestViewTest, IsTakenThoughOneFurtherAwaySharesMore) {
  const Pose query = LooksFrom({0.4, 0, 20.1});
  more_[23] = Verify(query, 20).inliers * 3 / 2;
  EXPECT_EQ(Nearest(query, 23), 20);
}

TEST_F(NearestViewTest, IsTheSameOnAPathThatWasGoneTheOtherWay) {
  for (int i = 0; i < kPathViews; ++i) path_[static_cast<std::size_t>(i)] = LooksFrom({0, 0, 40.0 - i});
  EXPECT_EQ(Nearest(LooksFrom({-0.3, 0, 20.2}), 15), 20);
  EXPECT_EQ(Nearest(LooksFrom({-0.3, 0, 20.2}), 25), 20);
}

TEST_F(NearestViewTest, OfAPathAsideOrUpIsFoundToo) {
  Along({0.4, 0, 0});
  EXPECT_EQ(Nearest(LooksFrom({8.1, 0.1, 0.2}), 23), 20);
  Along({0, -0.1, 0.05});
  EXPECT_EQ(Nearest(LooksFrom({0.1, -2.03, 1.0}), 16), 20);
}

TEST_F(NearestViewTest, HowTheCameraIsTurnedDoesNotMatter) {
  for (const double yaw_deg : {-12.0, 5.0, 12.0}) {
    EXPECT_EQ(Nearest(LooksFrom({0.4, 0, 20.1}, yaw_deg), 23), 20) << yaw_deg;
  }
  // By hand: each view is turned as it comes, the way bends.
  for (int i = 0; i < kPathViews; ++i) {
    const double t = 0.25 * i;
    path_[static_cast<std::size_t>(i)] =
        LooksFrom({0.5 * std::cos(t), 0.3 * std::sin(1.7 * t), 0.3 * t}, 5 * std::sin(2.3 * t));
  }
  const Eigen::Vector3d beside = path_[20].translation + Eigen::Vector3d(0.02, -0.03, 0.02);
  for (const int start : {17, 19, 21, 22}) EXPECT_EQ(Nearest(LooksFrom(beside, 4), start), 20) << start;
}

TEST_F(NearestViewTest, IsFoundWithTheCameraThatIsKnown) {
  PinholeCamera camera;
  camera.width = kPathImage.width;
  camera.height = kPathImage.height;
  camera.fx = camera.fy = kPathFocal;
  camera.cx = 320;
  camera.cy = 240;
  query_.camera = camera;
  for (View& view : views_) view.camera = camera;
  EXPECT_EQ(Nearest(LooksFrom({0.4, 0.1, 20.2}, 10), 24), 20);
}

// One camera looks to the left, the other to the right: the road is aside of both, in opposite directions.
TEST_F(NearestViewTest, IsFoundByCamerasThatLookAside) {
  Along({0.5, 0, 0});
  const cv::Point2f right(static_cast<float>(kPathImage.width), 0);
  const auto joined = [&](View& view) {
    view.size.width = 2 * kPathImage.width;
    view.cameras = {cv::Rect({0, 0}, kPathImage), cv::Rect(cv::Point(right), kPathImage)};
  };
  joined(query_);
  for (View& view : views_) joined(view);
  const auto both = [&](int i) {
    Verification verification = Verify(LooksFrom({10.1, 0, 0}), i);
    const Verification other = Verify(LooksFrom({20.0 - 10.1, 0, 0}), 40 - i);
    verification.inliers += other.inliers;
    for (VerifiedMatch match : other.inlier_matches) {
      match.query += right;
      match.candidate += right;
      verification.inlier_matches.push_back(match);
    }
    return verification;
  };
  std::map<int, Verification> looked_at;
  const int nearest = FindNearestView(
      query_, 23, memory_, [&](int i) -> const View& { return views_[static_cast<std::size_t>(i)]; },
      [&](int i) -> const Verification& { return looked_at.try_emplace(i, both(i)).first->second; });
  EXPECT_EQ(nearest, 20);
}

TEST_F(NearestViewTest, IsTheStartWhereTheCameraStood) {
  Along({0, 0, 0});
  EXPECT_EQ(Nearest(LooksFrom({0.4, 0.1, 0.2})), kPathStart);
  EXPECT_LE(looked_at_.size(), 2U);
}

TEST_F(NearestViewTest, IsTheStartWhereNothingElseIsAccepted) {
  for (int i = 0; i < kPathViews; ++i) {
    if (i != 24) refused_.insert(i);
  }
  EXPECT_EQ(Nearest(LooksFrom({0.4, 0.1, 20.2}), 24), 24);
  EXPECT_EQ(looked_at_.size(), 3U) << "itself and its neighbours";
}

TEST_F(NearestViewTest, IsSoughtHalfWayWhereGeometryRefusesTheOneThatWasExpected) {
  refused_ = {20};
  const int nearest = Nearest(LooksFrom({0.4, 0.1, 20.1}), 24);
  EXPECT_TRUE(nearest == 21 || nearest == 22) << nearest;
}

TEST_F(NearestViewTest, IsTheLastOfThePathForAQueryBeyondIt) {
  EXPECT_EQ(Nearest(LooksFrom({0.4, 0.1, -2}), 3), 0);
  const int last = memory_.working_memory().back();
  EXPECT_EQ(Nearest(LooksFrom({0.4, 0.1, last + 3.0}), last - 3), last);
}

TEST_F(NearestViewTest, IsNoneFurtherThanSixteenLocations) {
  Along({0, 0, 0.2});
  EXPECT_EQ(Nearest(LooksFrom({0.1, 0, 5.0}), 5), 21);
}

}  // namespace
}  // namespace tutti::internal
