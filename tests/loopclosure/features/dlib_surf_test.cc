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
      EXPECT_NEAR(descriptors.at<float>(i, k), point.des(k), 2e-3) << "point " << i << ", value " << k;
    }
  }
  EXPECT_LE(other_angle, kPoints / 50);
}

}  // namespace
}  // namespace tutti
