#include "loopclosure/evaluation/view_overlap.h"

#include <gtest/gtest.h>

#include "core/numbers.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

constexpr int kViewWidth = 320, kViewHeight = 240;
constexpr double kViewFocal = 200;  // so 6.4 m of a plane 4 m away are seen

// A camera at x [m], so far turned about its y axis, before surfaces `depth_m` away in all of its image.
DepthView Before(float depth_m, double x_m = 0, double turned_deg = 0, double z_m = 0) {
  PinholeCamera camera;
  camera.width = kViewWidth, camera.height = kViewHeight;
  camera.fx = camera.fy = kViewFocal;
  camera.cx = (kViewWidth - 1) / 2.0, camera.cy = (kViewHeight - 1) / 2.0;
  const Pose pose(ExpSO3({0, turned_deg / kDegrees, 0}), {x_m, 0, z_m});
  return {pose, camera, cv::Mat(kViewHeight, kViewWidth, CV_32FC1, cv::Scalar(depth_m))};
}

TEST(ViewOverlap, ACameraMovedByHalfItsViewSharesHalf) {
  const DepthView a = Before(4), b = Before(4, 3.2);
  EXPECT_NEAR(a.SeenBy(b).value(), 0.5, 0.05);
  EXPECT_NEAR(b.SeenBy(a).value(), 0.5, 0.05);
  EXPECT_NEAR(a.SeenBy(Before(4, 1.6)).value(), 0.75, 0.05);
  EXPECT_DOUBLE_EQ(a.SeenBy(a).value(), 1);
  EXPECT_DOUBLE_EQ(a.SeenBy(Before(4, 7)).value(), 0);
}

TEST(ViewOverlap, TurnedAwayNothingIsShared) {
  EXPECT_DOUBLE_EQ(Before(4).SeenBy(Before(4, 0, 180)).value(), 0);
  EXPECT_NEAR(Before(4).AngleTo(Before(4, 0, 30)), 30, 1e-6);
}

// One stands before a wall, the other behind it: what is nearer hides, what is seen through is not there.
TEST(ViewOverlap, AWallBetweenHidesEverything) {
  const DepthView before = Before(2), behind = Before(4);
  EXPECT_DOUBLE_EQ(behind.SeenBy(before).value(), 0);
  EXPECT_DOUBLE_EQ(before.SeenBy(behind).value(), 0);
  EXPECT_DOUBLE_EQ(behind.SeenBy(Before(4.2F)).value(), 1) << "within 5 cm and 5 %";
}

// From near, a quarter of the plane is seen: all of that from far.
TEST(ViewOverlap, NearAndFarDifferByDirection) {
  const DepthView far = Before(4), near = Before(2, 0, 0, 2);
  EXPECT_DOUBLE_EQ(near.SeenBy(far).value(), 1);
  EXPECT_NEAR(far.SeenBy(near).value(), 0.25, 0.05);
}

TEST(ViewOverlap, HolesAreDoubtsAndMostlyHolesSayNothing) {
  PinholeCamera camera;
  camera.width = kViewWidth, camera.height = kViewHeight;
  camera.fx = camera.fy = kViewFocal;
  camera.cx = (kViewWidth - 1) / 2.0, camera.cy = (kViewHeight - 1) / 2.0;
  cv::Mat depth(kViewHeight, kViewWidth, CV_32FC1, cv::Scalar(4));
  depth(cv::Rect(0, 0, kViewWidth / 2, kViewHeight)) = 0;
  const DepthView half(Pose(), camera, depth);
  EXPECT_DOUBLE_EQ(Before(4).SeenBy(half).value(), 1);
  depth(cv::Rect(0, 0, kViewWidth * 9 / 10, kViewHeight)) = 0;
  const DepthView tenth(Pose(), camera, depth);
  EXPECT_FALSE(Before(4).SeenBy(tenth).has_value());
  EXPECT_FALSE(tenth.SeenBy(Before(4)).has_value());
  camera.width = 10;
  EXPECT_THROW(DepthView(Pose(), camera, depth), InputError);
}

TEST(LoopsFromOverlap, LabelsByTheLargerOfBothDirections) {
  std::vector<std::optional<DepthView>> views = {
      Before(4),           // 0
      Before(4, 20),       // 1: elsewhere
      std::nullopt,        // 2: nothing is known of it
      Before(4, 3.2),      // 3: half of image 0
      Before(2, 0, 0, 2),  // 4: a quarter of image 0, and all of its own
      Before(4, -6.1),     // 5: 5 % of image 0
      Before(4, 1.6, 0),   // 6: three quarters of image 0, all of image 4
  };
  const std::vector<double> stamps = {0, 10, 20, 30, 40, 50, 60};
  const LoopGroundTruth truth = LoopsFromOverlap(views, stamps, {0.3, 0.1, 20});
  EXPECT_EQ(truth.At(3, 0), LoopLabel::kLoop);
  EXPECT_EQ(truth.At(3, 1), LoopLabel::kNone);
  EXPECT_EQ(truth.At(3, 2), LoopLabel::kIgnore) << "nothing is known of image 2";
  EXPECT_EQ(truth.At(4, 0), LoopLabel::kLoop) << "from near: all of it, though a quarter of the other";
  EXPECT_EQ(truth.At(5, 0), LoopLabel::kNone);
  EXPECT_EQ(truth.At(5, 4), LoopLabel::kIgnore) << "younger than 20 s";
  EXPECT_EQ(truth.RowsWithLoop(), 3);
  ASSERT_EQ(truth.best_views.size(), 7u);
  EXPECT_EQ(truth.best_views[3].column, 0);
  EXPECT_NEAR(truth.best_views[3].overlap, 0.5, 0.05);
  EXPECT_EQ(truth.best_views[6].column, 4) << "all of what image 4 sees";
  EXPECT_EQ(truth.best_views[5].column, -1);
  EXPECT_EQ(truth.First(4).best_views.size(), 4u);
}

TEST(LoopsFromOverlap, ARuleOutOfRangeIsRefused) {
  for (const OverlapRule& rule : {OverlapRule{0, 0, 10}, OverlapRule{1.1, 0.1, 10}, OverlapRule{0.3, 0.4, 10},
                                  OverlapRule{0.3, -0.1, 10}, OverlapRule{0.3, 0.1, -1}})
    EXPECT_THROW(LoopsFromOverlap({}, {}, rule), InputError);
}

}  // namespace
}  // namespace tutti::internal
