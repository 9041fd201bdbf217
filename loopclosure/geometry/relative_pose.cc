#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <random>
#include <vector>

#include "core/least_squares.h"
#include "core/numbers.h"
#include "core/reprojection.h"
#include "core/umeyama.h"
#include "tutti/loopclosure/relative_pose.h"

namespace tutti {
namespace {

constexpr double kMinDepth = 1e-6;  // in front of the camera
constexpr internal::GaussNewtonLimits kLimits{4};
using Reprojection = internal::Reprojection<2>;

// A camera without distortion, and pixels as it would see them: RANSAC and refinement then need no lens
// model.
Eigen::Vector2d UndistortedPixel(const PinholeCamera& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector3d ray = camera.Unproject(pixel);
  return {camera.fx * ray.x() + camera.cx, camera.fy * ray.y() + camera.cy};
}

double SquaredError(const PinholeCamera& camera, const Eigen::Vector3d& point, const Eigen::Vector2d& pixel) {
  Eigen::Vector2d r;
  if (!Reprojection::Residual(camera, point, {pixel}, kMinDepth, &r, nullptr))
    return std::numeric_limits<double>::infinity();
  return r.squaredNorm();
}

std::string TooFew(const char* what, std::size_t have, int need) {
  return "only " + std::to_string(have) + " " + what + ", " + std::to_string(need) + " are needed";
}

// RANSAC with a truncated-squares score (MSAC, Torr & Zisserman 2000) and a generator of its own.

constexpr int kSample = 3;  // matches that a model is fitted to

// `fit(sample)` gives the models through the sampled indices; `error(model, i)` the squared error of datum i
// relative to the squared threshold (1 = at the threshold; infinity where impossible). Returns the inliers
// of the best model and sets `best`. Deterministic for a seed: the generator is local and the draws do not
// depend on the standard library.
template <typename Model, typename Fit, typename Error>
std::vector<int> Ransac(int count, const RelativePoseOptions& options, const Fit& fit, const Error& error,
                        Model& best) {
  std::vector<int> best_inliers;
  if (count < kSample) return best_inliers;
  std::mt19937_64 generator(options.seed);
  double best_cost = static_cast<double>(count);
  int needed = options.max_iterations;
  std::vector<int> sample;
  for (int iteration = 0; iteration < needed; ++iteration) {
    sample.clear();
    while (static_cast<int>(sample.size()) < kSample) {
      const int i = static_cast<int>(generator() % static_cast<std::uint64_t>(count));
      if (std::find(sample.begin(), sample.end(), i) == sample.end()) sample.push_back(i);
    }
    for (const Model& model : fit(sample)) {
      double cost = 0.0;
      for (int i = 0; i < count && cost < best_cost; ++i) cost += std::min(1.0, error(model, i));
      if (!(cost < best_cost)) continue;
      best_cost = cost;
      best = model;
      best_inliers.clear();
      for (int i = 0; i < count; ++i) {
        if (error(model, i) < 1.0) best_inliers.push_back(i);
      }
      const double share = static_cast<double>(best_inliers.size()) / count;
      const double miss = 1.0 - std::pow(share, kSample);
      if (miss <= 0.0) return best_inliers;
      const double wanted = std::ceil(std::log(1.0 - options.confidence) / std::log(miss));
      needed = static_cast<int>(std::min<double>(options.max_iterations, std::max(20.0, wanted)));
    }
  }
  return best_inliers;
}

// ---------------------------------------------------------------- PnP

struct PnpProblem {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;  // undistorted
  std::vector<double> sigma_m;          // empty or one each
  PinholeCamera camera;
};

std::vector<Pose> FitP3p(const PnpProblem& problem, const std::vector<int>& sample) {
  std::vector<cv::Point3d> object;
  std::vector<cv::Point2d> image;
  for (const int i : sample) {
    const Eigen::Vector3d& p = problem.points[internal::Index(i)];
    const Eigen::Vector2d& u = problem.pixels[internal::Index(i)];
    object.emplace_back(p.x(), p.y(), p.z());
    image.emplace_back((u.x() - problem.camera.cx) / problem.camera.fx,
                       (u.y() - problem.camera.cy) / problem.camera.fy);
  }
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  cv::solveP3P(object, image, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotations, translations,
               cv::SOLVEPNP_AP3P);
  std::vector<Pose> poses;
  for (std::size_t k = 0; k < rotations.size(); ++k) {
    const Eigen::Vector3d w(rotations[k].at<double>(0), rotations[k].at<double>(1),
                            rotations[k].at<double>(2));
    const Eigen::Vector3d t(translations[k].at<double>(0), translations[k].at<double>(1),
                            translations[k].at<double>(2));
    const Pose pose(ExpSO3(w), t);
    if (pose.IsFinite()) poses.push_back(pose);
  }
  return poses;
}

// Residual of a point and its Jacobian under Exp(tangent) * T_camera_points; false: behind the camera.
bool PnpTerms(const PnpProblem& problem, const Pose& T_camera_points, std::size_t i,
              Eigen::Vector2d& residual, Reprojection::PoseJacobian& jacobian) {
  const Eigen::Vector3d p = T_camera_points * problem.points[i];
  Reprojection::PointJacobian by_point;
  if (!Reprojection::Residual(problem.camera, p, {problem.pixels[i]}, kMinDepth, &residual, &by_point))
    return false;
  jacobian = Reprojection::ByPose(by_point, p);
  return true;
}

bool RefinePnp(const PnpProblem& problem, const std::vector<int>& inliers, double huber_px,
               Pose& T_camera_points) {
  const auto linearise = [&](internal::NormalEquations<6>& equations) {
    for (const int i : inliers) {
      Eigen::Vector2d r;
      Reprojection::PoseJacobian j;
      if (!PnpTerms(problem, T_camera_points, internal::Index(i), r, j)) continue;
      equations.Add(j, r, internal::HuberWeight(r.squaredNorm(), huber_px * huber_px));
    }
  };
  const auto move = [&](const Vector6d& step) {
    T_camera_points = ExpSE3(step) * T_camera_points;
    return T_camera_points.IsFinite();
  };
  return internal::GaussNewton<6>(kLimits, linearise, move);
}

std::vector<int> PnpInliers(const PnpProblem& problem, const Pose& T_camera_points, double threshold_px) {
  std::vector<int> inliers;
  for (std::size_t i = 0; i < problem.points.size(); ++i) {
    if (SquaredError(problem.camera, T_camera_points * problem.points[i], problem.pixels[i]) <
        threshold_px * threshold_px) {
      inliers.push_back(static_cast<int>(i));
    }
  }
  return inliers;
}

void FinishPnp(const PnpProblem& problem, const RelativePoseOptions& options, PnpResult& result) {
  double squares = 0.0;
  for (const int i : result.inliers) {
    const std::size_t k = internal::Index(i);
    Eigen::Vector2d r;
    Reprojection::PoseJacobian j;
    if (!PnpTerms(problem, result.T_camera_points, k, r, j)) continue;
    squares += r.squaredNorm();
    double variance = options.pixel_sigma * options.pixel_sigma;
    if (!problem.sigma_m.empty()) {
      const double depth = (result.T_camera_points * problem.points[k]).z();
      const double pixels = problem.camera.fx * problem.sigma_m[k] / depth;
      variance += pixels * pixels;
    }
    result.information += j.transpose() * j / variance;
  }
  result.rmse_px = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, result.inliers.size())));
}

// ---------------------------------------------------------------- Sim(3)

struct SimilarityProblem {
  std::vector<Eigen::Vector3d> points_a, points_b;
  std::vector<Eigen::Vector2d> pixels_a, pixels_b;  // undistorted
  PinholeCamera camera_a, camera_b;
};

// The larger of the squared errors in the two images.
double SimilarityError(const SimilarityProblem& problem, const Similarity& S_a_b, const Similarity& S_b_a,
                       std::size_t i) {
  const double in_a = SquaredError(problem.camera_a, S_a_b * problem.points_b[i], problem.pixels_a[i]);
  const double in_b = SquaredError(problem.camera_b, S_b_a * problem.points_a[i], problem.pixels_b[i]);
  return std::max(in_a, in_b);
}

struct ScoredSimilarity {
  Similarity S_a_b, S_b_a;
};

std::vector<ScoredSimilarity> FitSimilarity(const SimilarityProblem& problem,
                                            const std::vector<int>& sample) {
  std::vector<Eigen::Vector3d> a;
  std::vector<Eigen::Vector3d> b;
  for (const int i : sample) {
    a.push_back(problem.points_a[internal::Index(i)]);
    b.push_back(problem.points_b[internal::Index(i)]);
  }
  const std::optional<Similarity> S = internal::Umeyama(a, b, true);
  if (!S || !(S->scale > 0.0)) return {};
  return {{*S, S->Inverse()}};
}

using Jacobian2x7 = Eigen::Matrix<double, 2, 7>;

// Residuals and Jacobians in both images under S_a_b * X, X = (Exp(rotation) e^scale, translation), tangent
// (t, w, s):
//   q = X p_b:          dq = [I, -[p_b]x, p_b],   p_a' = S_a_b q
//   r = S_b_a p_a:      d(X^-1 r) = [-I, [r]x, -r]
// False: behind a camera.
bool SimilarityTerms(const SimilarityProblem& problem, const Similarity& S_a_b, const Similarity& S_b_a,
                     std::size_t i, Eigen::Vector2d residuals[2], Jacobian2x7 jacobians[2]) {
  const Eigen::Vector3d in_a = S_a_b * problem.points_b[i], in_b = S_b_a * problem.points_a[i];
  Reprojection::PointJacobian by_a, by_b;
  if (!Reprojection::Residual(problem.camera_a, in_a, {problem.pixels_a[i]}, kMinDepth, &residuals[0],
                              &by_a) ||
      !Reprojection::Residual(problem.camera_b, in_b, {problem.pixels_b[i]}, kMinDepth, &residuals[1], &by_b))
    return false;
  Eigen::Matrix<double, 3, 7> dq, dr;
  dq << Eigen::Matrix3d::Identity(), -Skew(problem.points_b[i]), problem.points_b[i];
  dr << -Eigen::Matrix3d::Identity(), Skew(in_b), -in_b;
  jacobians[0] = by_a * S_a_b.scale * S_a_b.rotation.toRotationMatrix() * dq;
  jacobians[1] = by_b * dr;
  return true;
}

bool RefineSimilarity(const SimilarityProblem& problem, const std::vector<int>& inliers, double huber_px,
                      Similarity& S_a_b) {
  const auto linearise = [&](internal::NormalEquations<7>& equations) {
    const Similarity S_b_a = S_a_b.Inverse();
    for (const int i : inliers) {
      Eigen::Vector2d r[2];
      Jacobian2x7 j[2];
      if (!SimilarityTerms(problem, S_a_b, S_b_a, internal::Index(i), r, j)) continue;
      for (int side = 0; side < 2; ++side) {
        equations.Add(j[side], r[side], internal::HuberWeight(r[side].squaredNorm(), huber_px * huber_px));
      }
    }
  };
  const auto move = [&](const Vector7d& step) {
    if (std::abs(step[6]) > 1.0) return false;
    S_a_b = S_a_b * Similarity(std::exp(step[6]), ExpSO3(step.segment<3>(3)), step.head<3>());
    return S_a_b.translation.allFinite() && std::isfinite(S_a_b.scale) && S_a_b.scale > 0.0;
  };
  return internal::GaussNewton<7>(kLimits, linearise, move);
}

std::vector<int> SimilarityInliers(const SimilarityProblem& problem, const Similarity& S_a_b,
                                   double threshold_px) {
  const Similarity S_b_a = S_a_b.Inverse();
  std::vector<int> inliers;
  for (std::size_t i = 0; i < problem.points_a.size(); ++i) {
    if (SimilarityError(problem, S_a_b, S_b_a, i) < threshold_px * threshold_px)
      inliers.push_back(static_cast<int>(i));
  }
  return inliers;
}

void FinishSimilarity(const SimilarityProblem& problem, const RelativePoseOptions& options,
                      SimilarityResult& result) {
  const Similarity S_b_a = result.S_a_b.Inverse();
  const double variance = options.pixel_sigma * options.pixel_sigma;
  double squares = 0.0;
  for (const int i : result.inliers) {
    Eigen::Vector2d r[2];
    Jacobian2x7 j[2];
    if (!SimilarityTerms(problem, result.S_a_b, S_b_a, internal::Index(i), r, j)) continue;
    for (int side = 0; side < 2; ++side) {
      squares += 0.5 * r[side].squaredNorm();
      result.information += j[side].transpose() * j[side] / variance;
    }
  }
  result.rmse_px = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, result.inliers.size())));
}

// Refines the model on its inliers and chooses the inliers anew, a few times; keeps the last state that did
// not lose any support.
template <typename Model, typename Fit, typename Select>
void RefineOnInliers(int rounds, const Fit& fit, const Select& select, Model& model,
                     std::vector<int>& inliers) {
  for (int round = 0; round < rounds; ++round) {
    Model refined = model;
    if (!fit(inliers, refined)) return;
    std::vector<int> selected = select(refined);
    if (selected.size() < inliers.size()) return;
    const bool same = selected == inliers;
    model = refined;
    inliers.swap(selected);
    if (same) return;
  }
}

}  // namespace

std::string RelativePoseOptions::Validate() const {
  if (!(threshold_px > 0)) return "threshold_px must be above 0";
  if (!(pixel_sigma > 0)) return "pixel_sigma must be above 0";
  if (min_inliers < 4) return "min_inliers must be at least 4";
  if (!(confidence > 0 && confidence < 1)) return "confidence must be between 0 and 1";
  if (max_iterations < 1) return "max_iterations must be at least 1";
  if (refine_rounds < 1) return "refine_rounds must be at least 1";
  return {};
}

PnpResult SolvePnp(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector2d>& pixels,
                   const PinholeCamera& camera, const RelativePoseOptions& options,
                   const std::vector<double>& point_sigma_m) {
  PnpResult result;
  if (points.size() != pixels.size() || (!point_sigma_m.empty() && point_sigma_m.size() != points.size())) {
    result.reason = "points, pixels and standard deviations differ in number";
    return result;
  }
  if (static_cast<int>(points.size()) < std::max(4, options.min_inliers)) {
    result.reason = TooFew("matches with a 3D point", points.size(), std::max(4, options.min_inliers));
    return result;
  }
  PnpProblem problem{points, {}, point_sigma_m, camera};
  for (const Eigen::Vector2d& pixel : pixels) problem.pixels.push_back(UndistortedPixel(camera, pixel));

  const double squared = options.threshold_px * options.threshold_px;
  result.inliers = Ransac<Pose>(
      static_cast<int>(points.size()), options,
      [&](const std::vector<int>& sample) { return FitP3p(problem, sample); },
      [&](const Pose& pose, int i) {
        const std::size_t k = internal::Index(i);
        return SquaredError(camera, pose * problem.points[k], problem.pixels[k]) / squared;
      },
      result.T_camera_points);
  if (result.inliers.size() >= 4) {
    RefineOnInliers(
        options.refine_rounds,
        [&](const std::vector<int>& inliers, Pose& pose) {
          return RefinePnp(problem, inliers, 0.5 * options.threshold_px, pose);
        },
        [&](const Pose& pose) { return PnpInliers(problem, pose, options.threshold_px); },
        result.T_camera_points, result.inliers);
    FinishPnp(problem, options, result);
  }
  result.success = static_cast<int>(result.inliers.size()) >= options.min_inliers;
  if (!result.success)
    result.reason = TooFew("inliers of the pose", result.inliers.size(), options.min_inliers);
  return result;
}

SimilarityResult SolveSimilarity(const std::vector<Eigen::Vector3d>& points_a,
                                 const std::vector<Eigen::Vector2d>& pixels_a, const PinholeCamera& camera_a,
                                 const std::vector<Eigen::Vector3d>& points_b,
                                 const std::vector<Eigen::Vector2d>& pixels_b, const PinholeCamera& camera_b,
                                 const RelativePoseOptions& options) {
  SimilarityResult result;
  const std::size_t n = points_a.size();
  if (points_b.size() != n || pixels_a.size() != n || pixels_b.size() != n) {
    result.reason = "points and pixels of the two images differ in number";
    return result;
  }
  if (static_cast<int>(n) < std::max(4, options.min_inliers)) {
    result.reason = TooFew("matches with 3D points in both images", n, std::max(4, options.min_inliers));
    return result;
  }
  SimilarityProblem problem{points_a, points_b, {}, {}, camera_a, camera_b};
  for (const Eigen::Vector2d& pixel : pixels_a) problem.pixels_a.push_back(UndistortedPixel(camera_a, pixel));
  for (const Eigen::Vector2d& pixel : pixels_b) problem.pixels_b.push_back(UndistortedPixel(camera_b, pixel));

  const double squared = options.threshold_px * options.threshold_px;
  ScoredSimilarity best;
  result.inliers = Ransac<ScoredSimilarity>(
      static_cast<int>(n), options,
      [&](const std::vector<int>& sample) { return FitSimilarity(problem, sample); },
      [&](const ScoredSimilarity& model, int i) {
        return SimilarityError(problem, model.S_a_b, model.S_b_a, internal::Index(i)) / squared;
      },
      best);
  result.S_a_b = best.S_a_b;
  if (result.inliers.size() >= 4) {
    RefineOnInliers(
        options.refine_rounds,
        [&](const std::vector<int>& inliers, Similarity& S) {
          return RefineSimilarity(problem, inliers, 0.5 * options.threshold_px, S);
        },
        [&](const Similarity& S) { return SimilarityInliers(problem, S, options.threshold_px); },
        result.S_a_b, result.inliers);
    FinishSimilarity(problem, options, result);
  }
  result.success = static_cast<int>(result.inliers.size()) >= options.min_inliers;
  if (!result.success)
    result.reason = TooFew("inliers of the similarity", result.inliers.size(), options.min_inliers);
  return result;
}

}  // namespace tutti
