#include "apps/export/keyframe_images.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

using Sharpnesses = std::vector<std::optional<double>>;

// Cameras at these places on a line, all looking the same way.
std::vector<ModelKeyframe> OnALine(const std::vector<double>& places) {
  std::vector<ModelKeyframe> keyframes;
  for (const double x : places) {
    ModelKeyframe keyframe;
    keyframe.id = static_cast<int>(keyframes.size());
    keyframe.T_world_camera.translation.x() = x;
    keyframes.push_back(keyframe);
  }
  return keyframes;
}

TEST(ChooseImages, TakesAllWhereThereAreFew) {
  EXPECT_EQ(ChooseImages(OnALine({0, 1, 2}), {1.0, 1.0, 1.0}, 3), std::vector<std::size_t>({0, 1, 2}));
}

TEST(ChooseImages, LeavesOutWhatHasNoImage) {
  EXPECT_EQ(ChooseImages(OnALine({0, 1, 2}), {1.0, std::nullopt, 1.0}, 3), std::vector<std::size_t>({0, 2}));
}

TEST(ChooseImages, OfACrowdAtOnePlaceOnlyOneStays) {
  const auto line = OnALine({0, 1, 2, 2.01, 2.02, 2.03, 3, 4});
  const auto chosen = ChooseImages(line, Sharpnesses(8, 1.0), 5);
  ASSERT_EQ(chosen.size(), 5u);
  EXPECT_EQ(chosen[1], 1u);
  EXPECT_TRUE(chosen[2] >= 2 && chosen[2] <= 5);
  EXPECT_EQ(chosen[3], 6u);
}

TEST(ChooseImages, OfEquallySpacedOnesTheBlurredGo) {
  const auto line = OnALine({0, 1, 2, 3, 4, 5, 6});
  EXPECT_EQ(ChooseImages(line, {9.0, 9.0, 2.0, 9.0, 3.0, 9.0, 9.0}, 5),
            std::vector<std::size_t>({0, 1, 3, 5, 6}));
}

// A place with little to see has a small variance of the Laplacian in all its images.
TEST(ChooseImages, SharpnessIsComparedWithTheNeighboursAlone) {
  std::vector<double> places;
  Sharpnesses sharpness;
  for (int i = 0; i < 40; ++i) {
    places.push_back(i);
    sharpness.emplace_back(i < 20 ? 1.0 : 100.0);
  }
  const auto chosen = ChooseImages(OnALine(places), sharpness, 20);
  std::size_t plain = 0;
  for (const std::size_t k : chosen) plain += k < 20 ? 1 : 0;
  EXPECT_GE(plain, 8u);
  EXPECT_LE(plain, 12u);
}

TEST(ChooseImages, TurningOnTheSpotIsAWay) {
  std::vector<ModelKeyframe> turning = OnALine({0, 0, 0, 0, 0, 0, 0});
  for (std::size_t i = 0; i < turning.size(); ++i)
    turning[i].T_world_camera.rotation = ExpSO3({0, 0.2 * static_cast<double>(i), 0});
  turning[3].T_world_camera.rotation = ExpSO3({0, 0.41, 0});  // nearly that of 2
  const auto chosen = ChooseImages(turning, Sharpnesses(7, 1.0), 6);
  ASSERT_EQ(chosen.size(), 6u);
  EXPECT_EQ(chosen[2] == 2 || chosen[2] == 3, true);
  EXPECT_EQ(chosen[3], 4u);
}

TEST(ChooseImages, AloneIsTheSharpest) {
  EXPECT_EQ(ChooseImages(OnALine({0, 1, 2}), {1.0, 3.0, 2.0}, 1), std::vector<std::size_t>({1}));
}

}  // namespace
}  // namespace tutti
