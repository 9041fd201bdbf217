#include "frontend/features/rectifier.h"

#include <gtest/gtest.h>

#include "frontend/dataset/rectified_rig.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

PinholeCamera Euroc(double fx, double cx, Distortion distortion) {
  PinholeCamera c = Pinhole(fx, fx, cx, 248.4, {752, 480});
  c.distortion = distortion;
  if (distortion == Distortion::kRadTan) c.coefficients = {-0.2834, 0.0740, 0.00019, 0.00002, 0};
  if (distortion == Distortion::kEquidistant) c.coefficients = {0.01, -0.005, 0.002, 0, 0};
  return c;
}

// Images whose grey value is the column or the row: after warping they tell where a pixel came from.
cv::Mat Coordinates(const PinholeCamera& camera, bool rows) {
  cv::Mat image(camera.height, camera.width, CV_32FC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) image.at<float>(y, x) = static_cast<float>(rows ? y : x);
  }
  return image;
}

void ExpectWarpsRays(const Rectifier& rectifier, const PinholeCamera& source,
                     const Eigen::Matrix3d& R_source_target) {
  const cv::Mat x = rectifier.Apply(Coordinates(source, false)),
                y = rectifier.Apply(Coordinates(source, true));
  for (int v = 1; v < source.height; v += 53) {
    for (int u = 1; u < source.width; u += 61) {
      const Eigen::Vector2d from = source.Project(R_source_target * rectifier.Camera().Unproject({u, v}));
      EXPECT_NEAR(x.at<float>(v, u), from.x(), 0.05);
      EXPECT_NEAR(y.at<float>(v, u), from.y(), 0.05);
    }
  }
}

TEST(RectifierTest, RemovesDistortionWithoutBlackBorders) {
  for (const Distortion distortion : {Distortion::kRadTan, Distortion::kEquidistant}) {
    const PinholeCamera camera = Euroc(458, 367, distortion);
    const Rectifier rectifier(camera);
    EXPECT_EQ(rectifier.Camera().distortion, Distortion::kNone);
    EXPECT_TRUE(rectifier.Camera().Validate().empty());
    ExpectWarpsRays(rectifier, camera, Eigen::Matrix3d::Identity());
    const cv::Mat white = rectifier.Apply(cv::Mat(camera.height, camera.width, CV_8UC1, cv::Scalar(255)));
    EXPECT_EQ(cv::countNonZero(white < 250), 0);
  }
}

TEST(RectifierTest, PublicTumCalibrationsWork) {
  PinholeCamera c = Pinhole(517.306408, 516.469215, 318.643040, 255.313989, {640, 480});
  c.distortion = Distortion::kRadTan;
  c.coefficients = {0.262383, -0.953104, -0.005358, 0.002628, 1.163314};
  const Rectifier rectifier(c);
  EXPECT_NEAR(rectifier.Camera().fx, c.fx, 60);
  EXPECT_NEAR(rectifier.Camera().fx / rectifier.Camera().fy, c.fx / c.fy, 1e-9);
  ExpectWarpsRays(rectifier, c, Eigen::Matrix3d::Identity());
}

TEST(RectifierTest, NoDistortionPassesTheImageAsItIs) {
  const PinholeCamera camera = Euroc(458, 367, Distortion::kNone);
  const cv::Mat image = Coordinates(camera, false);
  EXPECT_EQ(Rectifier(camera).Apply(image).data, image.data);
}

TEST(RectifierTest, DepthIsNotMixedAcrossEdges) {
  const PinholeCamera camera = Euroc(458, 367, Distortion::kRadTan);
  cv::Mat depth(camera.height, camera.width, CV_32FC1, cv::Scalar(1));
  depth.colRange(300, 752).setTo(5);
  const cv::Mat out = Rectifier(camera).Apply(depth, Sampling::kNearest);
  EXPECT_EQ(cv::countNonZero((out != 1) & (out != 5)), 0);
}

TEST(RectifierTest, StereoPointsShareTheRowAndDisparityIsDepth) {
  for (const Distortion distortion : {Distortion::kRadTan, Distortion::kEquidistant}) {
    const PinholeCamera left = Euroc(458, 367, distortion), right = Euroc(457, 380, distortion);
    const Pose T_right_left(ExpSO3({0.01, -0.015, 0.02}), {-0.11, 0.002, 0.001});
    const StereoRectification s = RectifyStereo(left, right, T_right_left);
    EXPECT_NEAR(s.baseline_m, T_right_left.translation.norm(), 1e-12);
    EXPECT_EQ(s.left.Camera().cx, s.right.Camera().cx);
    EXPECT_EQ(s.left.Camera().fx, s.right.Camera().fx);
    const Eigen::Matrix3d R_left = s.T_left_rectified.rotation.toRotationMatrix();
    ExpectWarpsRays(s.left, left, R_left);
    // The rectified right camera is the rectified left one, moved by the baseline along x.
    const Eigen::Matrix3d R_right = T_right_left.rotation.toRotationMatrix() * R_left;
    ExpectWarpsRays(s.right, right, R_right);
    const Eigen::Vector3d right_position = s.T_left_rectified.Inverse() * T_right_left.Inverse().translation;
    EXPECT_NEAR((right_position - Eigen::Vector3d(s.baseline_m, 0, 0)).norm(), 0, 1e-9);
  }
}

TEST(RectifierTest, SwappedCamerasAreRefused) {
  const PinholeCamera camera = Euroc(458, 367, Distortion::kRadTan);
  EXPECT_THROW(RectifyStereo(camera, camera, Pose(Eigen::Quaterniond::Identity(), {0.11, 0, 0})), InputError);
  PinholeCamera small = camera;
  small.width = 640;
  EXPECT_THROW(RectifyStereo(camera, small, Pose(Eigen::Quaterniond::Identity(), {-0.11, 0, 0})), InputError);
}

}  // namespace
}  // namespace tutti
