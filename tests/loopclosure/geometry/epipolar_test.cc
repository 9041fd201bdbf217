// Models between two images of a known motion.
#include "loopclosure/geometry/epipolar.h"

#include <gtest/gtest.h>

#include "tests/loopclosure/geometry/two_poses.h"
#include "tests/support/plain_camera.h"

namespace tutti::internal {
namespace {

// Focal lengths that differ, by axis and by camera, and a lens that distorts.
PinholeCamera FirstOfTwo() {
  PinholeCamera camera = testing::PlainCamera(480);
  camera.fy = 470;
  camera.cx = 310;
  return camera;
}

PinholeCamera SecondOfTwo() {
  PinholeCamera camera = testing::PlainCamera(530);
  camera.fx = 540;
  camera.cy = 250;
  camera.distortion = Distortion::kRadTan;
  camera.coefficients[0] = -0.1;
  return camera;
}

const Pose kSecondFirst(ExpSO3({0.03, -0.08, 0.05}), {0.6, -0.2, -0.4});

// Every tenth match is wrong by far.
testing::SeenTwice WithWrongMatches(testing::SeenTwice seen) {
  for (std::size_t i = 0; i < seen.second.size(); i += 10)
    seen.second[i] = {640 - seen.second[i].x, seen.second[i].y + (seen.second[i].y < 240 ? 90.f : -90.f)};
  return seen;
}

int NumWrong(const std::vector<int>& inliers) {
  int wrong = 0;
  for (const int i : inliers) wrong += i % 10 == 0 ? 1 : 0;
  return wrong;
}

TEST(FitEssential, FindsRotationAndDirectionOfTwoDifferentCameras) {
  const testing::SeenTwice seen =
      WithWrongMatches(testing::SeeTwice(FirstOfTwo(), SecondOfTwo(), kSecondFirst, false));
  const EpipolarResult result = FitEssential(seen.first, FirstOfTwo(), seen.second, SecondOfTwo(), {});
  EXPECT_GE(result.inliers.size(), 108u);
  EXPECT_LE(NumWrong(result.inliers), 1);
  EXPECT_LT(LogSO3(result.T_second_first.rotation.conjugate() * kSecondFirst.rotation).norm(), 1e-3);
  EXPECT_LT((result.T_second_first.translation - kSecondFirst.translation.normalized()).norm(), 2e-3);
}

TEST(FitEssential, IsHeldToItsThresholdInPixels) {
  testing::SeenTwice seen = testing::SeeTwice(FirstOfTwo(), SecondOfTwo(), kSecondFirst, false);
  // The epipolar lines are nowhere near vertical: half of the matches are off by so much.
  for (std::size_t i = 0; i < seen.second.size(); i += 4) seen.second[i].y += 6;
  EpipolarSettings settings;
  const std::size_t all = seen.first.size();
  EXPECT_LT(FitEssential(seen.first, FirstOfTwo(), seen.second, SecondOfTwo(), settings).inliers.size(),
            0.8 * all);
  settings.threshold_px = 10;
  EXPECT_GT(FitEssential(seen.first, FirstOfTwo(), seen.second, SecondOfTwo(), settings).inliers.size(),
            0.95 * all);
}

TEST(FitFundamental, LeavesOutWrongMatches) {
  const PinholeCamera camera = testing::PlainCamera(500);
  const Pose T_second_first(ExpSO3({0.02, 0.05, -0.03}), {0.2, 0.1, -0.9});
  const testing::SeenTwice seen = WithWrongMatches(testing::SeeTwice(camera, camera, T_second_first, false));
  const EpipolarResult result = FitFundamental(seen.first, seen.second, {});
  EXPECT_GE(result.inliers.size(), 108u);
  EXPECT_LE(NumWrong(result.inliers), 2);
}

TEST(FitHomography, OfACameraThatTurnedIsItsRotation) {
  const Pose T_second_first(kSecondFirst.rotation, {0, 0, 0});
  const testing::SeenTwice seen =
      WithWrongMatches(testing::SeeTwice(FirstOfTwo(), SecondOfTwo(), T_second_first, false));
  const HomographyResult result = FitHomography(seen.first, FirstOfTwo(), seen.second, SecondOfTwo(), {});
  EXPECT_EQ(result.inliers.size(), 108u);
  ASSERT_TRUE(result.turned);
  EXPECT_LT(LogSO3(result.R_second_first.conjugate() * kSecondFirst.rotation).norm(), 1e-4);
}

TEST(FitHomography, OfAFlatSceneIsNoRotation) {
  const PinholeCamera camera = testing::PlainCamera(500);
  const testing::SeenTwice seen = testing::SeeTwice(camera, camera, kSecondFirst, true);
  const HomographyResult result = FitHomography(seen.first, camera, seen.second, camera, {});
  EXPECT_EQ(result.inliers.size(), seen.first.size());
  EXPECT_FALSE(result.turned);
  EXPECT_EQ(FitHomography(seen.first, std::nullopt, seen.second, std::nullopt, {}).inliers.size(),
            seen.first.size());
}

// At about 6 m, 2 mm are a fifth of a pixel and 50 mm four pixels.
TEST(FitHomography, IsARotationWhereTheWayIsTooShortToShow) {
  const PinholeCamera camera = testing::PlainCamera(500);
  const auto turned = [&](double aside_m) {
    const testing::SeenTwice seen =
        testing::SeeTwice(camera, camera, Pose(kSecondFirst.rotation, {0, 0, aside_m}), true);
    return FitHomography(seen.first, camera, seen.second, camera, {}).turned;
  };
  EXPECT_TRUE(turned(0.002));
  EXPECT_FALSE(turned(0.2));
}

TEST(EpipolarModels, NeedEightMatches) {
  const PinholeCamera camera = testing::PlainCamera(500);
  for (const std::size_t count : {7u, 8u}) {
    testing::SeenTwice deep = testing::SeeTwice(camera, camera, kSecondFirst, false);
    testing::SeenTwice flat = testing::SeeTwice(camera, camera, kSecondFirst, true);
    for (auto* pixels : {&deep.first, &deep.second, &flat.first, &flat.second}) pixels->resize(count);
    const std::size_t expected = count == 8 ? 8 : 0;
    EXPECT_EQ(FitEssential(deep.first, camera, deep.second, camera, {}).inliers.size(), expected);
    EXPECT_EQ(FitFundamental(deep.first, deep.second, {}).inliers.size(), expected);
    EXPECT_EQ(FitHomography(flat.first, camera, flat.second, camera, {}).inliers.size(), expected);
  }
}

}  // namespace
}  // namespace tutti::internal
