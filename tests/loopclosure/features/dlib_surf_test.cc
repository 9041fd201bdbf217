// tutti's faster sums against dlib's own functions.
#define cblas_dscal tutti_cblas_dscal  // defined in the library: dlib's BLAS is not linked
#define cblas_daxpy tutti_cblas_daxpy  // clang leaves a call where nothing comes by
#include <dlib/image_keypoint/surf.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/loopclosure/features/textured_image.h"
#include "tutti/loopclosure/features.h"

extern "C" void tutti_cblas_daxpy(CBLAS_INT_TYPE, double, const double*, CBLAS_INT_TYPE, double*,
                                  CBLAS_INT_TYPE) {
  ADD_FAILURE() << "dlib needs BLAS after all";
}

namespace tutti {
namespace {

TEST(DlibSurf, GivesThePointsAndDescriptorsOfDlib) {
  constexpr int kPoints = 300;
  const cv::Mat image = testing::TexturedImage(3, 640, 480);
  dlib::array2d<unsigned char> copy(image.rows, image.cols);
  for (int r = 0; r < image.rows; ++r) std::copy_n(image.ptr(r), image.cols, &copy[r][0]);
  const std::vector<dlib::surf_point> expected = dlib::get_surf_points(copy, 2000, 1.0);
  ASSERT_GE(static_cast<int>(expected.size()), kPoints);

  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  CreateDlibSurf(kPoints, 4, 1.0)->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
  ASSERT_EQ(static_cast<int>(keypoints.size()), kPoints);
  int other_angle = 0;
  for (int i = 0; i < kPoints; ++i) {
    const cv::KeyPoint& keypoint = keypoints[static_cast<std::size_t>(i)];
    // Points of the same strength may come in another order.
    const auto same = std::find_if(expected.begin(), expected.end(), [&](const dlib::surf_point& p) {
      return std::abs(p.p.center.x() - keypoint.pt.x) < 1e-3 &&
             std::abs(p.p.center.y() - keypoint.pt.y) < 1e-3;
    });
    ASSERT_NE(same, expected.end()) << "point " << i << " at " << keypoint.pt;
    const dlib::surf_point& point = *same;
    // Samples at the rim of a slice may fall to either side where a keypoint is rounded to float.
    const double apart = std::remainder(keypoint.angle - point.angle * 180.0 / CV_PI, 360.0);
    if (std::abs(apart) > 1e-3) {
      ++other_angle;
      continue;
    }
    for (int k = 0; k < descriptors.cols; ++k) {
      const double rounding = std::sqrt(std::abs(point.des(k))) / 128 + 1e-4;
      EXPECT_NEAR(descriptors.at<float>(i, k), point.des(k), rounding + 2e-3)
          << "point " << i << ", value " << k;
    }
  }
  EXPECT_LE(other_angle, kPoints / 50);
}

// Down to the faintest and up to the border; of four intervals, where dlib has six as it stands.
TEST(DlibSurf, FindsEveryPointOfDlibAndNoOther) {
  const cv::Mat image = testing::TexturedImage(5, 401, 303);
  dlib::array2d<unsigned char> copy(image.rows, image.cols);
  for (int r = 0; r < image.rows; ++r) std::copy_n(image.ptr(r), image.cols, &copy[r][0]);
  dlib::hessian_pyramid pyramid;
  dlib::integral_image sums;
  sums.load(copy);
  pyramid.build_pyramid(sums, 4, 4, 2);
  std::vector<dlib::interest_point> found, expected;
  dlib::get_interest_points(pyramid, 1.0, found);
  const dlib::rectangle inside(0, 0, image.cols - 1, image.rows - 1);
  for (const dlib::interest_point& point : found) {
    const auto border = static_cast<unsigned long>(32 * point.scale);
    if (inside.contains(dlib::centered_rect(dlib::point(point.center), border, border)))
      expected.push_back(point);
  }
  std::vector<cv::KeyPoint> keypoints;
  CreateDlibSurf(100000, 4, 1.0)->detect(image, keypoints);
  EXPECT_GT(expected.size(), 200u);
  EXPECT_EQ(keypoints.size(), expected.size());
  for (const dlib::interest_point& point : expected) {
    EXPECT_TRUE(std::any_of(keypoints.begin(), keypoints.end(),
                            [&](const cv::KeyPoint& k) {
                              return std::abs(point.center.x() - k.pt.x) < 1e-3 &&
                                     std::abs(point.center.y() - k.pt.y) < 1e-3 &&
                                     std::abs(20 * point.scale - k.size) < 1e-3 &&
                                     std::abs(point.score - k.response) < 1e-3 * point.score &&
                                     (point.laplacian > 0) == (k.class_id > 0);
                            }))
        << point.center.x() << ", " << point.center.y();
  }
}

TEST(DlibSurf, FindsNothingUnderTheMaskAndDescribesWhatLiesFarEnoughInside) {
  const cv::Mat image = testing::TexturedImage(5, 401, 303);
  cv::Mat mask(image.size(), CV_8UC1, cv::Scalar(255)), descriptors;
  mask.colRange(0, 200).setTo(0);
  std::vector<cv::KeyPoint> keypoints;
  const cv::Ptr<cv::Feature2D> surf = CreateDlibSurf(1000, 4, 1.0);
  surf->detect(image, keypoints, mask);
  ASSERT_FALSE(keypoints.empty());
  for (const cv::KeyPoint& keypoint : keypoints) EXPECT_GE(keypoint.pt.x, 199.5);
  // A window of 32 scales about it: 64 pixels for a scale of 2.
  keypoints = {cv::KeyPoint(200, 150, 40), cv::KeyPoint(31, 150, 40), cv::KeyPoint(33, 150, 40),
               cv::KeyPoint(200, 150, 0)};
  surf->compute(image, keypoints, descriptors);
  ASSERT_EQ(keypoints.size(), 2u);
  EXPECT_EQ(descriptors.rows, 2);
  EXPECT_EQ(keypoints[1].pt.x, 33);
  for (int i = 0; i < 2; ++i) EXPECT_NEAR(cv::norm(descriptors.row(i)), 1, 0.02);
}

}  // namespace
}  // namespace tutti
