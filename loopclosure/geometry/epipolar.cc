#include "loopclosure/geometry/epipolar.h"

#include <cmath>
#include <opencv2/calib3d.hpp>

#include "core/dense_solvers.h"
#include "core/numbers.h"

namespace tutti::internal {
namespace {

constexpr std::size_t kMinMatches = 8;

cv::UsacParams Usac(const EpipolarSettings& settings, double threshold) {
  cv::UsacParams parameters;
  parameters.confidence = 0.9999;
  parameters.isParallel = false;
  parameters.loIterations = 10;
  parameters.loMethod = cv::LOCAL_OPTIM_INNER_LO;
  parameters.loSampleSize = 14;
  parameters.maxIterations = 1000;
  parameters.neighborsSearch = cv::NEIGH_GRID;
  parameters.randomGeneratorState = static_cast<int>(settings.seed & 0x7fffffff);
  parameters.sampler = cv::SAMPLING_UNIFORM;
  parameters.score = cv::SCORE_METHOD_MSAC;
  parameters.threshold = threshold;
  return parameters;
}

std::vector<int> Selected(const cv::Mat& mask) {
  std::vector<int> inliers;
  for (int i = 0; i < static_cast<int>(mask.total()); ++i) {
    if (mask.at<std::uint8_t>(i) != 0) inliers.push_back(i);
  }
  return inliers;
}

// Pixels as a common, undistorted camera would see them: the threshold then means pixels for both images.
std::vector<cv::Point2d> Undistorted(const std::vector<cv::Point2f>& pixels, const PinholeCamera& camera) {
  std::vector<cv::Point2d> rays;
  for (const cv::Point2f& p : pixels) {
    const Eigen::Vector3d ray = camera.Unproject({p.x, p.y});
    rays.emplace_back(ray.x(), ray.y());
  }
  return rays;
}

// The rotation that is nearest to a homography between rays.
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& homography) {
  const Eigen::Matrix3d sign = homography.determinant() < 0 ? -homography : homography;
  const internal::Svd3 svd = internal::SingularValues(sign);
  const Eigen::Matrix3d R = svd.u * svd.v.transpose();
  return R.determinant() < 0 ? Eigen::Matrix3d::Identity() : R;
}

// Inliers whose pixels the rotation takes to within the threshold [px].
int FittedByRotation(const Eigen::Matrix3d& R, double focal, const std::vector<cv::Point2d>& first,
                     const std::vector<cv::Point2d>& second, const std::vector<int>& inliers,
                     double threshold) {
  int fitted = 0;
  for (const int i : inliers) {
    const std::size_t k = Index(i);
    const Eigen::Vector3d turned = R * Eigen::Vector3d(first[k].x, first[k].y, focal);
    if (turned.z() <= 0) continue;
    const double error = std::hypot(focal * turned.x() / turned.z() - second[k].x,
                                    focal * turned.y() / turned.z() - second[k].y);
    if (error < threshold) ++fitted;
  }
  return fitted;
}

}  // namespace

EpipolarResult FitFundamental(const std::vector<cv::Point2f>& first, const std::vector<cv::Point2f>& second,
                              const EpipolarSettings& settings) {
  EpipolarResult result;
  if (first.size() < kMinMatches || first.size() != second.size()) return result;
  cv::Mat mask;
  try {
    const cv::Mat f = cv::findFundamentalMat(first, second, mask, Usac(settings, settings.threshold_px));
    if (f.rows != 3 || f.cols != 3) return result;
    result.inliers = Selected(mask);
  } catch (const cv::Exception&) {
    result.inliers.clear();  // a degenerate set of points is no model, not an error
  }
  return result;
}

EpipolarResult FitEssential(const std::vector<cv::Point2f>& first, const PinholeCamera& first_camera,
                            const std::vector<cv::Point2f>& second, const PinholeCamera& second_camera,
                            const EpipolarSettings& settings) {
  EpipolarResult result;
  if (first.size() < kMinMatches || first.size() != second.size()) return result;
  const std::vector<cv::Point2d> a = Undistorted(first, first_camera);
  const std::vector<cv::Point2d> b = Undistorted(second, second_camera);
  const double focal = 0.25 * (first_camera.fx + first_camera.fy + second_camera.fx + second_camera.fy);
  const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat mask;
  try {
    const cv::Mat e = cv::findEssentialMat(a, b, identity, identity, cv::noArray(), cv::noArray(), mask,
                                           Usac(settings, settings.threshold_px / focal));
    if (e.rows != 3 || e.cols != 3) return result;
    cv::Mat rotation;
    cv::Mat translation;
    constexpr double kFar = 1e4;  // in baselines; points of a small motion lie far
    cv::Mat triangulated;
    cv::recoverPose(e, a, b, identity, rotation, translation, kFar, mask, triangulated);
    result.inliers = Selected(mask);
    Eigen::Matrix<double, 3, 4> matrix;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) matrix(r, c) = rotation.at<double>(r, c);
      matrix(r, 3) = translation.at<double>(r);
    }
    result.T_second_first = Pose::FromMatrix(matrix);
  } catch (const cv::Exception&) {
    result = EpipolarResult();  // a degenerate set of points is no model, not an error
  }
  return result;
}

HomographyResult FitHomography(const std::vector<cv::Point2f>& first,
                               const std::optional<PinholeCamera>& first_camera,
                               const std::vector<cv::Point2f>& second,
                               const std::optional<PinholeCamera>& second_camera,
                               const EpipolarSettings& settings) {
  constexpr double kNearlyAll = 0.9;
  HomographyResult result;
  if (first.size() < kMinMatches || first.size() != second.size()) return result;
  const bool calibrated = first_camera && second_camera;
  std::vector<cv::Point2d> a(first.begin(), first.end());
  std::vector<cv::Point2d> b(second.begin(), second.end());
  double focal = 1.0;  // of the common, undistorted camera
  if (calibrated) {
    focal = 0.25 * (first_camera->fx + first_camera->fy + second_camera->fx + second_camera->fy);
    a = Undistorted(first, *first_camera);
    b = Undistorted(second, *second_camera);
    for (cv::Point2d& p : a) p *= focal;
    for (cv::Point2d& p : b) p *= focal;
  }
  cv::Mat mask;
  try {
    const cv::Mat h = cv::findHomography(a, b, mask, Usac(settings, settings.threshold_px));
    if (h.rows != 3 || h.cols != 3) return result;
    result.inliers = Selected(mask);
    if (calibrated) {
      Eigen::Matrix3d matrix;
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) matrix(r, c) = h.at<double>(r, c);
      }
      const Eigen::Vector3d camera(focal, focal, 1);
      const Eigen::Matrix3d R =
          NearestRotation(camera.cwiseInverse().asDiagonal() * matrix * camera.asDiagonal());
      const int fitted = FittedByRotation(R, focal, a, b, result.inliers, settings.threshold_px);
      result.turned =
          !result.inliers.empty() && fitted >= kNearlyAll * static_cast<double>(result.inliers.size());
      if (result.turned) result.R_second_first = Eigen::Quaterniond(R);
    }
  } catch (const cv::Exception&) {
    result = HomographyResult();  // a degenerate set of points is no model, not an error
  }
  return result;
}

}  // namespace tutti::internal
