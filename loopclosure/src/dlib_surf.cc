// dlib's matrices scale through BLAS where dlib was configured with it. Here that is one vector of 64
// numbers: our own function takes its place, so that tutti needs neither BLAS nor libdlib at link time.
#define cblas_dscal tutti_cblas_dscal
#include <dlib/image_keypoint/surf.h>
#include <dlib/image_transforms/integral_image.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "tutti/loopclosure/features.h"

extern "C" void tutti_cblas_dscal(const CBLAS_INT_TYPE n, const double alpha, double* x,
                                  const CBLAS_INT_TYPE step);
extern "C" void tutti_cblas_dscal(const CBLAS_INT_TYPE n, const double alpha, double* x,
                                  const CBLAS_INT_TYPE step) {
  for (CBLAS_INT_TYPE i = 0; i < n; ++i) x[i * step] *= alpha;
}

namespace tutti {
namespace {

constexpr int kDescriptorSize = 64;
constexpr double kBorder = 32.0;  // dlib describes a point from a window of this many scales
constexpr float kSizePerScale =
    20.0f;  // SURF describes a patch of 20 scales: the diameter that cv::KeyPoint wants

using Integral = dlib::integral_image_generic<int>;

class DlibSurf : public cv::Feature2D {
 public:
  DlibSurf(int max_features, int octaves, double threshold)
      : max_features_(max_features), octaves_(octaves), threshold_(threshold) {}

  void detectAndCompute(cv::InputArray image, cv::InputArray mask, std::vector<cv::KeyPoint>& keypoints,
                        cv::OutputArray descriptors, bool use_provided) override {
    const cv::Mat grey = image.getMat();
    CV_Assert(grey.type() == CV_8UC1);
    Integral integral;
    LoadIntegral(grey, integral);
    if (!use_provided) Detect(integral, mask.getMat(), keypoints);
    if (descriptors.needed()) Describe(integral, keypoints, descriptors);
  }

  int descriptorSize() const override { return kDescriptorSize; }
  int descriptorType() const override { return CV_32F; }
  int defaultNorm() const override { return cv::NORM_L2; }
  cv::String getDefaultName() const override { return "tutti.DlibSurf"; }

 private:
  static void LoadIntegral(const cv::Mat& grey, Integral& integral) {
    dlib::array2d<unsigned char> copy(grey.rows, grey.cols);
    for (int r = 0; r < grey.rows; ++r) std::copy_n(grey.ptr(r), grey.cols, &copy[r][0]);
    integral.load(copy);
  }

  static bool Describable(const Integral& integral, const dlib::vector<double, 2>& centre, double scale) {
    const unsigned long border = static_cast<unsigned long>(kBorder * scale);
    return get_rect(integral).contains(dlib::centered_rect(dlib::point(centre), border, border));
  }

  void Detect(const Integral& integral, const cv::Mat& mask, std::vector<cv::KeyPoint>& keypoints) const {
    dlib::hessian_pyramid pyramid;
    pyramid.build_pyramid(integral, octaves_, 6, 2);
    std::vector<dlib::interest_point> points;
    dlib::get_interest_points(pyramid, threshold_, points);
    std::stable_sort(points.begin(), points.end(),
                     [](const auto& a, const auto& b) { return a.score > b.score; });
    keypoints.clear();
    for (const dlib::interest_point& point : points) {
      if (static_cast<int>(keypoints.size()) >= max_features_) break;
      if (!Describable(integral, point.center, point.scale)) continue;
      const float x = static_cast<float>(point.center.x());
      const float y = static_cast<float>(point.center.y());
      if (!mask.empty() && mask.at<std::uint8_t>(cvRound(y), cvRound(x)) == 0) continue;
      keypoints.emplace_back(x, y, static_cast<float>(point.scale) * kSizePerScale, -1.0f,
                             static_cast<float>(point.score), 0, point.laplacian > 0 ? 1 : -1);
    }
  }

  // Describes the keypoints that lie far enough inside; drops the others, as cv::Feature2D::compute may.
  static void Describe(const Integral& integral, std::vector<cv::KeyPoint>& keypoints,
                       cv::OutputArray descriptors) {
    std::vector<cv::KeyPoint> kept;
    cv::Mat rows(static_cast<int>(keypoints.size()), kDescriptorSize, CV_32F);
    for (cv::KeyPoint keypoint : keypoints) {
      const dlib::vector<double, 2> centre(keypoint.pt.x, keypoint.pt.y);
      const double scale = static_cast<double>(keypoint.size / kSizePerScale);
      if (scale <= 0 || !Describable(integral, centre, scale)) continue;
      const double angle = dlib::compute_dominant_angle(integral, centre, scale);
      dlib::matrix<double, kDescriptorSize, 1> values;
      dlib::compute_surf_descriptor(integral, centre, scale, angle, values);
      float* row = rows.ptr<float>(static_cast<int>(kept.size()));
      for (int i = 0; i < kDescriptorSize; ++i) row[i] = static_cast<float>(values(i));
      keypoint.angle = static_cast<float>(angle * 180.0 / CV_PI);
      if (keypoint.angle < 0) keypoint.angle += 360.0f;
      kept.push_back(keypoint);
    }
    keypoints.swap(kept);
    rows.rowRange(0, static_cast<int>(keypoints.size())).copyTo(descriptors);
  }

  int max_features_;
  int octaves_;
  double threshold_;
};

}  // namespace

cv::Ptr<cv::Feature2D> CreateDlibSurf(int max_features, int octaves, double threshold) {
  return cv::makePtr<DlibSurf>(max_features, octaves, threshold);
}

}  // namespace tutti
