#include "frontend/geometry/two_view.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "core/dense_solvers.h"
#include "core/reprojection.h"
#include "frontend/geometry/pose_solver.h"

namespace tutti {
namespace {

// With a translation of length 1.
Pose ToPose(const cv::Mat& rotation, const cv::Mat& translation) {
  Eigen::Matrix<double, 3, 4> m;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) m(r, c) = rotation.at<double>(r, c);
    m(r, 3) = translation.at<double>(r);
  }
  Pose pose = Pose::FromMatrix(m);
  const double n = pose.translation.norm();
  if (n > 1e-12) pose.translation /= n;
  return pose;
}

// The first two coordinates of (x/z, y/z, 1).
std::vector<Eigen::Vector2d> Rays(const PinholeCamera& camera, const std::vector<cv::Point2f>& pixels) {
  std::vector<Eigen::Vector2d> rays;
  rays.reserve(pixels.size());
  for (const cv::Point2f& pixel : pixels)
    rays.push_back(camera.Unproject(Eigen::Vector2d(pixel.x, pixel.y)).head<2>());
  return rays;
}

// Points in front of both cameras that reproject within the bound.
struct Trial {
  int good = 0;
  double parallax_deg = 0;
  std::vector<Eigen::Vector3d> points;
  std::vector<char> valid;
};

Trial Test(const PinholeCamera& camera, const Pose& T, const std::vector<cv::Point2f>& first,
           const std::vector<cv::Point2f>& second, const std::vector<char>& use, double sigma) {
  Trial trial;
  trial.points.assign(first.size(), Eigen::Vector3d::Zero());
  trial.valid.assign(first.size(), 0);
  std::vector<double> parallaxes;
  const Eigen::Vector3d centre = T.Inverse().translation;
  for (std::size_t i = 0; i < first.size(); ++i) {
    if (!use[i]) continue;
    const Eigen::Vector2d a(first[i].x, first[i].y), b(second[i].x, second[i].y);
    const Eigen::Vector3d p = Triangulate(camera.Unproject(a), camera.Unproject(b), T);
    if (!p.allFinite() || p.z() <= 0) continue;
    const Eigen::Vector3d q = T * p;
    if (q.z() <= 0) continue;
    if ((camera.Project(p) - a).squaredNorm() > 5.991 * sigma * sigma ||
        (camera.Project(q) - b).squaredNorm() > 5.991 * sigma * sigma)
      continue;
    const double cosine = std::clamp(p.normalized().dot((p - centre).normalized()), -1.0, 1.0);
    const double parallax = std::acos(cosine) * 180 / M_PI;
    ++trial.good;
    parallaxes.push_back(parallax);
    if (parallax < 0.3) continue;  // too far to have a depth
    trial.points[i] = p;
    trial.valid[i] = 1;
  }
  if (!parallaxes.empty()) {
    // The median of the better half: far points say nothing about whether near ones can be triangulated.
    const std::size_t k = parallaxes.size() * 3 / 4;
    std::nth_element(parallaxes.begin(), parallaxes.begin() + static_cast<std::ptrdiff_t>(k),
                     parallaxes.end());
    trial.parallax_deg = parallaxes[k];
  }
  return trial;
}

// Robust score of a model: sum of (bound - squared error) over inliers.
double HomographyScore(const Eigen::Matrix3d& h, const std::vector<cv::Point2f>& first,
                       const std::vector<cv::Point2f>& second, double sigma) {
  const Eigen::Matrix3d inverse = h.inverse();
  double score = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const Eigen::Vector3d a(first[i].x, first[i].y, 1), b(second[i].x, second[i].y, 1);
    for (const double e : {((h * a).hnormalized() - b.head<2>()).squaredNorm(),
                           ((inverse * b).hnormalized() - a.head<2>()).squaredNorm()}) {
      const double chi2 = e / (sigma * sigma);
      if (chi2 < 5.991) score += 5.991 - chi2;
    }
  }
  return score;
}

double EpipolarScore(const Eigen::Matrix3d& f, const std::vector<cv::Point2f>& first,
                     const std::vector<cv::Point2f>& second, double sigma, std::vector<char>* inliers) {
  inliers->assign(first.size(), 0);
  double score = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const Eigen::Vector3d a(first[i].x, first[i].y, 1), b(second[i].x, second[i].y, 1);
    const Eigen::Vector3d lb = f * a, la = f.transpose() * b;
    const double e = b.dot(lb);
    const double eb = e * e / lb.head<2>().squaredNorm() / (sigma * sigma),
                 ea = e * e / la.head<2>().squaredNorm() / (sigma * sigma);
    if (ea < 3.841 && eb < 3.841) {
      (*inliers)[i] = 1;
      score += 2 * 5.991 - ea - eb;
    }
  }
  return score;
}

std::vector<Pose> MotionsOfHomography(const cv::Mat& homography, const PinholeCamera& camera) {
  const cv::Matx33d k(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  std::vector<cv::Mat> rotations, translations, normals;
  cv::decomposeHomographyMat(homography, cv::Mat(k), rotations, translations, normals);
  std::vector<Pose> motions;
  for (std::size_t i = 0; i < rotations.size(); ++i) motions.push_back(ToPose(rotations[i], translations[i]));
  return motions;
}

std::vector<Pose> MotionsOfEssential(const Eigen::Matrix3d& essential) {
  cv::Mat e, r1, r2, t;
  cv::eigen2cv(essential, e);
  cv::decomposeEssentialMat(e, r1, r2, t);
  const cv::Mat minus = -t;
  return {ToPose(r1, t), ToPose(r1, minus), ToPose(r2, t), ToPose(r2, minus)};
}

}  // namespace

Eigen::Vector3d Triangulate(const Eigen::Vector3d& first_ray, const Eigen::Vector3d& second_ray,
                            const Pose& T_second_first) {
  const Eigen::Matrix<double, 3, 4> p = T_second_first.Matrix().topRows<3>();
  Eigen::Matrix4d a;
  a.row(0) = Eigen::RowVector4d(-1, 0, first_ray.x(), 0);
  a.row(1) = Eigen::RowVector4d(0, -1, first_ray.y(), 0);
  a.row(2) = second_ray.x() * p.row(2) - p.row(0);
  a.row(3) = second_ray.y() * p.row(2) - p.row(1);
  const Eigen::Vector4d x = internal::SymmetricEigen(a.transpose() * a).vectors.col(0);
  return x.head<3>() / x(3);
}

// The points are eliminated (Schur complement); the scale is fixed by taking only the two directions across
// the translation. To the first order a left perturbation of T_second_first turns the baseline in the first
// camera by its translation alone.
double DirectionSigma(const PinholeCamera& camera, const Pose& T_second_first,
                      const std::vector<TwoViewPoint>& points) {
  using Projection = internal::Reprojection<2>;
  Matrix6d information = Matrix6d::Zero();
  const Eigen::Matrix3d rotation = T_second_first.rotation.toRotationMatrix();
  for (const TwoViewPoint& point : points) {
    const Eigen::Vector3d& p = point.in_first;
    const Eigen::Vector3d q = T_second_first * p;
    Eigen::Vector2d pixel;
    Projection::PointJacobian by_p, by_q;
    const auto weight = [](double sigma) { return Eigen::Vector2d::Constant(1 / sigma); };
    if (!Projection::Residual(camera, p, {Eigen::Vector2d::Zero(), weight(point.first_sigma_px)}, kMinDepth,
                              &pixel, &by_p) ||
        !Projection::Residual(camera, q, {Eigen::Vector2d::Zero(), weight(point.second_sigma_px)}, kMinDepth,
                              &pixel, &by_q))
      continue;
    const Projection::PoseJacobian by_pose = Projection::ByPose(by_q, q);
    const Projection::PointJacobian by_point = by_q * rotation;
    const Eigen::Matrix3d known = by_p.transpose() * by_p + by_point.transpose() * by_point;
    const Eigen::Matrix<double, 6, 3> shared = by_pose.transpose() * by_point;
    information += by_pose.transpose() * by_pose - shared * internal::SolveLdlt(known, shared.transpose());
  }
  const double length = T_second_first.translation.norm();
  if (!(length > 0)) return INFINITY;
  Eigen::Matrix<double, 6, 5> free = Eigen::Matrix<double, 6, 5>::Zero();
  free.block<3, 1>(0, 0) = T_second_first.translation.unitOrthogonal();
  free.block<3, 1>(0, 1) = T_second_first.translation.cross(free.block<3, 1>(0, 0)).normalized();
  free.block<3, 3>(3, 2).setIdentity();
  const Eigen::Matrix<double, 5, 5> of_free = free.transpose() * information * free;
  const auto covariance = internal::InverseInformation(of_free);
  if (!covariance) return INFINITY;
  const double variance =
      internal::SymmetricEigen(covariance->topLeftCorner<2, 2>()).values(1) / (length * length);
  return variance > 0 ? std::sqrt(variance) : INFINITY;
}

TwoViewResult EstimateTwoView(const PinholeCamera& camera, const std::vector<cv::Point2f>& first,
                              const std::vector<cv::Point2f>& second, const TwoViewOptions& options) {
  TwoViewResult result;
  if (static_cast<int>(first.size()) < std::max(8, options.min_points)) {
    result.reason = "only " + std::to_string(first.size()) + " matches between the two views";
    return result;
  }
  const double sigma = options.pixel_sigma;
  const std::optional<internal::EssentialMatrix> essential = internal::FitEssential(
      Rays(camera, first), Rays(camera, second), 1.5 * sigma / (0.5 * (camera.fx + camera.fy)), 0.9999);
  if (!essential) {
    result.reason = "no essential matrix fits the matches";
    return result;
  }
  const Eigen::Matrix3d k_inverse = camera.Matrix().inverse();
  std::vector<char> inliers;
  const double score_e =
      EpipolarScore(k_inverse.transpose() * essential->matrix * k_inverse, first, second, sigma, &inliers);
  // OpenCV's RANSAC seeds its own generator with a constant: deterministic.
  const cv::Mat homography =
      cv::findHomography(first, second, cv::RANSAC, 2.5 * sigma, cv::noArray(), 2000, 0.999);
  double score_h = 0;
  if (!homography.empty()) {
    Eigen::Matrix3d h;
    cv::cv2eigen(homography, h);
    if (std::abs(h.determinant()) > 1e-12) score_h = HomographyScore(h, first, second, sigma);
  }
  result.homography = score_h > 0.45 * (score_h + score_e) && !homography.empty();
  if (result.homography) inliers.assign(first.size(), 1);
  const std::vector<Pose> motions =
      result.homography ? MotionsOfHomography(homography, camera) : MotionsOfEssential(essential->matrix);
  int best = 0, second_best = 0;
  for (const Pose& motion : motions) {
    Trial trial = Test(camera, motion, first, second, inliers, 2.0 * sigma);
    second_best = std::max(second_best, std::min(best, trial.good));
    if (trial.good <= best) continue;
    best = trial.good;
    result.T_second_first = motion;
    result.points = std::move(trial.points);
    result.valid = std::move(trial.valid);
    result.parallax_deg = trial.parallax_deg;
  }
  const int candidates = static_cast<int>(std::count(inliers.begin(), inliers.end(), 1));
  const int valid = static_cast<int>(std::count(result.valid.begin(), result.valid.end(), 1));
  if (best < std::max(options.min_points, candidates / 2))
    result.reason = "only " + std::to_string(best) + " of " + std::to_string(candidates) +
                    " points lie in front of both cameras";
  else if (second_best > 0.75 * best)
    result.reason = "two motions explain the matches equally well";
  else if (result.parallax_deg < options.min_parallax_deg)
    result.reason =
        "the camera has hardly moved sideways (parallax " + std::to_string(result.parallax_deg) + " deg)";
  else if (valid < options.min_points)
    result.reason = "only " + std::to_string(valid) + " points have a depth";
  result.success = result.reason.empty();
  return result;
}

}  // namespace tutti
