#include "apps/slam/loop_constraint.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/slam/landmark_matches.h"
#include "core/dense_solvers.h"
#include "core/numbers.h"
#include "tutti/loopclosure/relative_pose.h"

namespace tutti {
namespace {

constexpr int kMinSimilarityInliers = 12;  // of 3D-3D matches; fewer leave the scale open

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
                                  const KeyframeView& query, const CameraRig& rig,
                                  const LoopDetectorOptions& detector) {
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
    const SimilarityResult fit = SimilarityOfLandmarks(verification, candidate, query, rig, detector.seed);
    if (!fit.success) {
      out.reason = "no scale for it: " + fit.reason;
      return out;
    }
    edge.S_candidate_query = fit.S_a_b;
    const double apart = fit.S_a_b.translation.norm() / edge.depth;
    if (apart > kMostLoopApart) {
      out.reason = "the two cameras stand too far apart for a scale: " + Percent(apart) +
                   " of the median scene depth, at most " + Percent(kMostLoopApart);
      return out;
    }
    information = fit.information;
  } else {
    if (verification.type != ConstraintType::kRigid) {
      // The detector knew the depths of two frames; the map has those of landmarks that many frames saw.
      const Verification metric = VerifyLandmarks(candidate, query, rig, detector);
      if (metric.accepted) return MakeLoopConstraint(metric, candidate, query, rig, detector);
      out.reason = "verified without depth, and the map's landmarks give none: " + metric.reason;
      return out;
    }
    edge.S_candidate_query = verification.S_candidate_query;
    edge.S_candidate_query.scale = 1;
    information = MakeInformation(verification.information, 1.0);
  }
  // The residual of an edge lives in the query's frame, the depth in the candidate's.
  const double sigma_translation = kLoopSigmaFraction * edge.depth / edge.S_candidate_query.scale;
  edge.information =
      WithFloor(information, sigma_translation, kLoopSigmaDeg * internal::kRadians, kLoopSigmaScale);
  out.usable = edge.information.allFinite();
  if (!out.usable) out.reason = "its information matrix is not finite";
  return out;
}

}  // namespace tutti
