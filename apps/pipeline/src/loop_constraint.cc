#include "loop_constraint.h"

#include <Eigen/LU>
#include <algorithm>

#include "tutti/loopclosure/relative_pose.h"

namespace tutti {
namespace {

constexpr double kRadians = 0.017453292519943295;
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
  const Matrix7d inverse = covariance.inverse();
  return 0.5 * (inverse + inverse.transpose());
}

SimilarityResult SimilarityOfLandmarks(const Verification& verification, const KeyframeView& candidate,
                                       const KeyframeView& query, const CameraRig& rig, std::uint64_t seed) {
  std::vector<Eigen::Vector3d> points_c, points_q;
  std::vector<Eigen::Vector2d> pixels_c, pixels_q;
  for (const VerifiedMatch& match : verification.inlier_matches) {
    if (match.candidate_feature < 0 || match.query_feature < 0) continue;
    const auto c = static_cast<std::size_t>(match.candidate_feature),
               q = static_cast<std::size_t>(match.query_feature);
    if (c >= candidate.points.size() || q >= query.points.size()) continue;
    if (!candidate.points[c].allFinite() || !query.points[q].allFinite()) continue;
    points_c.push_back(candidate.points[c]);
    points_q.push_back(query.points[q]);
    pixels_c.push_back(Pixel(candidate.keypoints[c]));
    pixels_q.push_back(Pixel(query.keypoints[q]));
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

double MedianDepth(const KeyframeView& view) {
  std::vector<double> depths;
  for (const Eigen::Vector3d& point : view.points) {
    if (point.allFinite() && point.z() > 0) depths.push_back(point.z());
  }
  if (depths.empty()) return 0;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
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
  edge.information =
      WithFloor(information, sigma_translation, options.loop_sigma_deg * kRadians, options.loop_sigma_scale);
  out.usable = edge.information.allFinite();
  if (!out.usable) out.reason = "its information matrix is not finite";
  return out;
}

}  // namespace tutti
