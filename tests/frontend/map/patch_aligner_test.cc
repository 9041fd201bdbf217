#include "frontend/map/patch_aligner.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "tests/support/plain_camera.h"

namespace tutti {
namespace {

const PinholeCamera kCamera = testing::PlainCamera(450);
const Eigen::Vector2d kPoint(301.3, 222.8);

cv::Mat Texture() {
  cv::Mat image(kCamera.height, kCamera.width, CV_8U);
  cv::RNG rng(3);
  rng.fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(image, image, {}, 2.0);
  cv::normalize(image, image, 20, 220, cv::NORM_MINMAX);
  return image;
}

// One feature at `at`.
FrameFeatures Frame(const cv::Mat& image, const Eigen::Vector2d& at) {
  FrameFeatures features;
  features.keypoints.emplace_back(static_cast<float>(at.x()), static_cast<float>(at.y()), 31.0F);
  features.keypoints[0].octave = 0;
  features.descriptors = cv::Mat::zeros(1, 32, CV_8U);
  features.inverse_depth = features.inverse_depth_sigma = {0.0F};
  features.aligned = {-1};
  features.pyramid = std::make_shared<const Pyramid>(BuildPyramid(image, OdometryOptions()));
  return features;
}

// The texture under p -> a p + t.
cv::Mat MovedImage(const cv::Mat& image, double a, const Eigen::Vector2d& t) {
  const cv::Matx23d m(a, 0, t.x(), 0, a, t.y());
  cv::Mat out;
  cv::warpAffine(image, out, m, image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
  return out;
}

TEST(PatchAligner, FindsAShiftToATenthOfAPixel) {
  const auto patch = CutPatch(kCamera, Frame(Texture(), kPoint), 0);
  ASSERT_NE(patch, nullptr);
  const Eigen::Vector2d shift(3.4, -1.7), truth = kPoint + shift;
  const FrameFeatures frame = Frame(MovedImage(Texture(), 1, shift), truth);
  const auto found =
      AlignPatch(*patch, frame, Eigen::Matrix2d::Identity(), truth + Eigen::Vector2d(1.0, -0.8));
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - truth).norm(), 0.1);
}

TEST(PatchAligner, FindsAPointThatCameNearerUnderOtherLight) {
  const auto patch = CutPatch(kCamera, Frame(Texture(), kPoint), 0);
  const double zoom = 1.3;
  const Eigen::Vector2d shift(-80, -60), truth = zoom * kPoint + shift;
  cv::Mat image = MovedImage(Texture(), zoom, shift);
  image.convertTo(image, -1, 0.7, 30);
  const auto found = AlignPatch(*patch, Frame(image, truth), Eigen::Matrix2d::Identity() * zoom,
                                truth + Eigen::Vector2d(0.7, 0.7));
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - truth).norm(), 0.15);
}

TEST(PatchAligner, RefusesWhatLooksDifferentOrHasNoTexture) {
  const auto patch = CutPatch(kCamera, Frame(Texture(), kPoint), 0);
  const Eigen::Matrix2d same = Eigen::Matrix2d::Identity();
  EXPECT_FALSE(
      AlignPatch(*patch, Frame(Texture(), kPoint), same, kPoint + Eigen::Vector2d(40, 25)).has_value());
  const cv::Mat blank(kCamera.height, kCamera.width, CV_8U, cv::Scalar(90));
  EXPECT_FALSE(AlignPatch(*patch, Frame(blank, kPoint), same, kPoint).has_value());
  const auto flat = CutPatch(kCamera, Frame(blank, kPoint), 0);
  EXPECT_FALSE(AlignPatch(*flat, Frame(Texture(), kPoint), same, kPoint).has_value());
}

TEST(PatchAligner, NoPatchBeyondTheImageOrWithoutOne) {
  EXPECT_EQ(CutPatch(kCamera, Frame(Texture(), {5, 200}), 0), nullptr);
  EXPECT_EQ(CutPatch(kCamera, *WithoutImages(Frame(Texture(), kPoint)), 0), nullptr);
}

TEST(PatchAligner, FindsThePointOfTwoFeaturesThatLookAlike) {
  const Pose T_b_a(Eigen::Quaterniond::Identity(), {-0.1, 0, 0});
  const Eigen::Vector3d in_a = 5.0 * kCamera.Unproject(kPoint);
  const Eigen::Vector2d truth = kCamera.Project(T_b_a * in_a);
  const FrameFeatures a = Frame(Texture(), kPoint);
  const cv::Mat image = MovedImage(Texture(), 1, truth - kPoint);
  const FrameFeatures b = Frame(image, truth + Eigen::Vector2d(1.1, 0.6));
  const auto found = FindPoint(kCamera, a, 0, b, 0, T_b_a, in_a);
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - truth).norm(), 0.1);
  const FrameFeatures elsewhere = Frame(image, truth + Eigen::Vector2d(40, 25));
  EXPECT_FALSE(FindPoint(kCamera, a, 0, elsewhere, 0, T_b_a, in_a).has_value());
  EXPECT_FALSE(FindPoint(kCamera, a, 0, *WithoutImages(b), 0, T_b_a, in_a).has_value());
}

TEST(PatchAligner, MovesTheKeypointsOfLandmarksAndTrustsThemMore) {
  CameraRig rig;
  rig.camera = kCamera;
  Map map(PyramidScales(OdometryOptions()), rig, 0.5);
  const Pose T_world_second(Eigen::Quaterniond::Identity(), {0.1, 0, 0});
  Keyframe keyframe;
  keyframe.features = std::make_shared<const FrameFeatures>(Frame(Texture(), kPoint));
  map.AddKeyframe(keyframe);
  const Eigen::Vector3d position = 5.0 * kCamera.Unproject(kPoint);
  const int landmark = map.AddLandmark(position, 0, 0);
  const Eigen::Vector2d truth = kCamera.Project(T_world_second.Inverse() * position);
  const FrameFeatures frame =
      Frame(MovedImage(Texture(), 1, truth - kPoint), truth + Eigen::Vector2d(1.1, 0.6));
  const auto moved = AlignFeatures(map, kCamera, T_world_second.Inverse(), {landmark}, frame);
  ASSERT_NE(moved, nullptr);
  const cv::Point2f& at = moved->keypoints[0].pt;
  EXPECT_LT((Eigen::Vector2d(at.x, at.y) - truth).norm(), 0.1);
  EXPECT_EQ(map.RelativeSigma(frame, -1, 0, landmark), 1.0);
  EXPECT_EQ(map.RelativeSigma(*moved, -1, 0, landmark), 0.5);
  EXPECT_EQ(map.RelativeSigma(*keyframe.features, 0, 0, landmark), 0.5);  // its patch is from here
  // A view that the patch is from or fitted counts, one that never fitted does not.
  keyframe.features = moved;
  map.AddKeyframe(keyframe);
  keyframe.features = std::make_shared<const FrameFeatures>(frame);
  map.AddKeyframe(keyframe);
  EXPECT_FALSE(map.Doubtful({0, 0}, landmark));
  EXPECT_FALSE(map.Doubtful({1, 0}, landmark));
  EXPECT_TRUE(map.Doubtful({2, 0}, landmark));
  // What is aligned already is left alone.
  EXPECT_EQ(AlignFeatures(map, kCamera, T_world_second.Inverse(), {landmark}, *moved), nullptr);
}

TEST(PatchAligner, FindsLandmarksWhereAPoseSaysThatTheyAreWhateverCornersThereAre) {
  CameraRig rig;
  rig.camera = kCamera;
  Map map(PyramidScales(OdometryOptions()), rig, 0.5);
  Keyframe keyframe;
  keyframe.features = std::make_shared<const FrameFeatures>(Frame(Texture(), kPoint));
  map.AddKeyframe(keyframe);
  const int landmark = map.AddLandmark(5.0 * kCamera.Unproject(kPoint), 0, 0);
  const Pose T_second_world(Eigen::Quaterniond::Identity(), {-0.1, 0, 0});  // 9 px to the left
  FrameFeatures second = Frame(MovedImage(Texture(), 1, {-9, 0}), {20, 20});
  const auto found = [&](double error_px) {
    const Pose about(Eigen::Quaterniond::Identity(), {-0.1 + 5 * error_px / kCamera.fx, 0, 0});
    return FindPatches(map, kCamera, about, {landmark}, second);
  };
  ASSERT_EQ(found(1.5).size(), 1U);
  EXPECT_EQ(found(1.5)[0].landmark, landmark);
  EXPECT_LT((found(1.5)[0].pixel - (kPoint + Eigen::Vector2d(-9, 0))).norm(), 0.1);
  EXPECT_NEAR(found(1.5)[0].scale, 1, 1e-6);
  EXPECT_TRUE(found(25).empty()) << "the patch looks different there";
  EXPECT_TRUE(found(1e4).empty()) << "beyond the image";
  second.rolled = {cv::Point2f(1, 0)};
  EXPECT_TRUE(found(1.5).empty()) << "a rolling shutter";
  second = *WithoutImages(second);
  EXPECT_TRUE(found(1.5).empty());
  map.RemoveLandmark(landmark);
  EXPECT_TRUE(FindPatches(map, kCamera, T_second_world, {landmark}, second).empty());
}

}  // namespace
}  // namespace tutti
