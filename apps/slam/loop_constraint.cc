#include "apps/slam/loop_constraint.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <set>
#include <utility>

#include "core/angle.h"
#include "core/dense_solvers.h"
#include "core/median.h"
#include "tutti/loopclosure/relative_pose.h"

namespace tutti {
namespace {

constexpr int kMinSimilarityInliers = 12;  // of 3D-3D matches; fewer leave the scale open
constexpr float kMaxHamming = 60;  // of 256 bits; beyond it two ORB descriptors have nothing in common

Eigen::Vector2d Pixel(const cv::KeyPoint& keypoint) { return {keypoint.pt.x, keypoint.pt.y}; }

// The inverse of (covariance + floor); a singular information counts as no knowledge beyond the floor.
Matrix7d WithFloor(const Matrix7d& information, double sigma_translation, double sigma_rotation,
                   double sigma_scale) {
  Matrix7d covariance = Matrix7d::Zero();
  const Eigen::FullPivLU<Matrix7d> lu(information);
  if (lu.isInvertible()) covariance = lu.inverse();
  if (!covariance.allFinite()) covariance.setZero();
  Vector7d floor;
  floor << Eigen::Vector3d::Constant(sigma_translation * sigma_translation),
      Eigen::Vector3d::Constant(sigma_rotation * sigma_rotation), sigma_scale * sigma_scale;
  covariance += floor.asDiagonal();
  const Matrix7d inverse = internal::Inverse(covariance);
  return 0.5 * (inverse + inverse.transpose());
}

std::string Percent(double share) { return std::to_string(std::lround(100 * share)) + " %"; }

bool IsLandmark(const KeyframeView& view, int feature) {
  return feature >= 0 && static_cast<std::size_t>(feature) < view.points.size() &&
         view.points[static_cast<std::size_t>(feature)].allFinite();
}

// Rows of the features that are landmarks, and which features they are.
cv::Mat LandmarkDescriptors(const KeyframeView& view, std::vector<int>& features) {
  cv::Mat rows;
  for (int i = 0; i < view.descriptors.rows; ++i) {
    if (!IsLandmark(view, i)) continue;
    features.push_back(i);
    rows.push_back(view.descriptors.row(i));
  }
  return rows;
}

}  // namespace

// The verification saw the query when it was new and had few landmarks.
std::vector<LandmarkMatch> LandmarkMatches(const Verification& verification, const KeyframeView& candidate,
                                           const KeyframeView& query) {
  std::vector<LandmarkMatch> matches;
  std::set<int> used_candidate, used_query;
  const auto add = [&](int c, int q) {
    if (!IsLandmark(candidate, c) || !IsLandmark(query, q)) return;
    if (!used_candidate.insert(c).second || !used_query.insert(q).second) return;
    matches.emplace_back(c, q);
  };
  for (const VerifiedMatch& match : verification.inlier_matches)
    add(match.candidate_feature, match.query_feature);
  std::vector<int> features_c, features_q;
  const cv::Mat rows_c = LandmarkDescriptors(candidate, features_c),
                rows_q = LandmarkDescriptors(query, features_q);
  if (rows_c.empty() || rows_q.empty()) return matches;
  std::vector<cv::DMatch> mutual;
  cv::BFMatcher(cv::NORM_HAMMING, true).match(rows_q, rows_c, mutual);
  for (const cv::DMatch& match : mutual) {
    if (match.distance > kMaxHamming) continue;
    add(features_c[static_cast<std::size_t>(match.trainIdx)],
        features_q[static_cast<std::size_t>(match.queryIdx)]);
  }
  return matches;
}

namespace {

SimilarityResult SimilarityOfLandmarks(const Verification& verification, const KeyframeView& candidate,
                                       const KeyframeView& query, const CameraRig& rig, std::uint64_t seed) {
  std::vector<Eigen::Vector3d> points_c, points_q;
  std::vector<Eigen::Vector2d> pixels_c, pixels_q;
  for (const auto& [c, q] : LandmarkMatches(verification, candidate, query)) {
    const auto i = static_cast<std::size_t>(c), j = static_cast<std::size_t>(q);
    points_c.push_back(candidate.points[i]);
    points_q.push_back(query.points[j]);
    pixels_c.push_back(Pixel(candidate.keypoints[i]));
    pixels_q.push_back(Pixel(query.keypoints[j]));
  }
  RelativePoseOptions options;
  options.threshold_px = 4.0;  // landmarks of a mono map carry their own error
  options.min_inliers = kMinSimilarityInliers;
  options.seed = seed;
  if (points_c.size() < static_cast<std::size_t>(kMinSimilarityInliers)) {
    SimilarityResult none;
    none.reason =
        "only " + std::to_string(points_c.size()) + " of its matches are landmarks in both keyframes";
    return none;
  }
  return SolveSimilarity(points_c, pixels_c, rig.camera, points_q, pixels_q, rig.camera, options);
}

}  // namespace

Verification Reversed(const Verification& verification, std::int64_t candidate) {
  Verification out = verification;
  out.candidate = candidate;
  out.S_candidate_query = verification.S_candidate_query.Inverse();
  // A motion of the one camera is one of the other, too: its information goes along by the adjoint.
  const Eigen::Matrix3d R = out.S_candidate_query.rotation.toRotationMatrix();
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = adjoint.bottomRightCorner<3, 3>() = R;
  adjoint.topRightCorner<3, 3>() = Skew(out.S_candidate_query.translation) * R;
  out.information = adjoint.transpose() * verification.information * adjoint;
  for (VerifiedMatch& match : out.inlier_matches) {
    std::swap(match.candidate, match.query);
    std::swap(match.candidate_feature, match.query_feature);
  }
  return out;
}

double MedianDepth(const KeyframeView& view) {
  std::vector<double> depths;
  for (const Eigen::Vector3d& point : view.points) {
    if (point.allFinite() && point.z() > 0) depths.push_back(point.z());
  }
  return internal::Median(std::move(depths));
}

LoopConstraint MakeLoopConstraint(const Verification& verification, const KeyframeView& candidate,
                                  const KeyframeView& query, const CameraRig& rig, const SlamOptions& options,
                                  std::uint64_t seed) {
  LoopConstraint out;
  LoopEdge& edge = out.edge;
  edge.candidate = candidate.id;
  edge.query = query.id;
  edge.candidate_frame = candidate.frame_index;
  edge.query_frame = query.frame_index;
  edge.depth = MedianDepth(candidate);
  if (edge.depth <= 0) {
    out.reason = "the candidate's keyframe has no landmarks";
    return out;
  }
  Matrix7d information = Matrix7d::Zero();
  if (rig.sensor == Sensor::kMono) {
    const SimilarityResult fit = SimilarityOfLandmarks(verification, candidate, query, rig, seed);
    if (!fit.success) {
      out.reason = "no scale for it: " + fit.reason;
      return out;
    }
    edge.S_candidate_query = fit.S_a_b;
    const double apart = fit.S_a_b.translation.norm() / edge.depth;
    if (apart > options.loop_apart_fraction) {
      out.reason = "the two cameras stand too far apart for a scale: " + Percent(apart) +
                   " of the median scene depth, at most " + Percent(options.loop_apart_fraction);
      return out;
    }
    information = fit.information;
  } else {
    if (verification.type != ConstraintType::kRigid) {
      out.reason = "verified without depth: no metric transform";
      return out;
    }
    edge.S_candidate_query = verification.S_candidate_query;
    edge.S_candidate_query.scale = 1;
    information = MakeInformation(verification.information, 1.0);
  }
  // The residual of an edge lives in the query's frame, the depth in the candidate's.
  const double sigma_translation = options.loop_sigma_fraction * edge.depth / edge.S_candidate_query.scale;
  edge.information = WithFloor(information, sigma_translation, options.loop_sigma_deg * internal::kRadians,
                               options.loop_sigma_scale);
  out.usable = edge.information.allFinite();
  if (!out.usable) out.reason = "its information matrix is not finite";
  return out;
}

}  // namespace tutti
