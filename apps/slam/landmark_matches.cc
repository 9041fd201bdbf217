#include "apps/slam/landmark_matches.h"

#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <set>

#include "loopclosure/geometry/evidence.h"
#include "tutti/loopclosure/relative_pose.h"

namespace tutti {
namespace {

constexpr int kMinInliers = 12;    // chance lets about 5 fit
constexpr float kMaxHamming = 60;  // of 256 bits; beyond it two ORB descriptors have nothing in common

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

// What is in one spot, a sign or a window that is there twice, is no place; nor does it tell a motion.
bool CoverBothImages(const std::vector<LandmarkMatch>& matches, const std::vector<int>& inliers,
                     const KeyframeView& candidate, const KeyframeView& query, const CameraRig& rig,
                     const VerificationOptions& verification) {
  std::vector<cv::Point2f> in_candidate, in_query;
  for (const int i : inliers) {
    const auto& [c, q] = matches[static_cast<std::size_t>(i)];
    in_candidate.push_back(candidate.keypoints[static_cast<std::size_t>(c)].pt);
    in_query.push_back(query.keypoints[static_cast<std::size_t>(q)].pt);
  }
  const cv::Size size(rig.camera.width, rig.camera.height);
  const double spread =
      std::min(internal::NarrowestSpread(in_candidate, size), internal::NarrowestSpread(in_query, size));
  return spread >=
         internal::SpreadNeeded(verification.min_spread, kMinInliers, static_cast<int>(inliers.size()));
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

Verification VerifyLandmarks(const KeyframeView& candidate, const KeyframeView& query, const CameraRig& rig,
                             const LoopDetectorOptions& detector) {
  Verification out;
  out.candidate = candidate.frame_index;
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  const std::vector<LandmarkMatch> matches = LandmarkMatches(Verification(), candidate, query);
  for (const auto& [c, q] : matches) {
    const cv::Point2f pixel = query.keypoints[static_cast<std::size_t>(q)].pt;
    points.push_back(candidate.points[static_cast<std::size_t>(c)]);
    pixels.emplace_back(pixel.x, pixel.y);
  }
  out.matches = static_cast<int>(points.size());
  RelativePoseOptions options;
  options.min_inliers = std::max(
      kMinInliers, static_cast<int>(std::ceil(detector.verification.min_inlier_ratio * out.matches)));
  options.seed = detector.seed;
  const PnpResult found = SolvePnp(points, pixels, rig.camera, options);
  out.inliers = static_cast<int>(found.inliers.size());
  out.reason = found.reason;
  if (!found.success) return out;
  if (!CoverBothImages(matches, found.inliers, candidate, query, rig, detector.verification)) {
    out.reason = "the matches cover too narrow a part of the image";
    return out;
  }
  out.accepted = true;
  out.type = rig.sensor == Sensor::kMono ? ConstraintType::kSimilarity : ConstraintType::kRigid;
  out.S_candidate_query = Similarity(found.T_camera_points.Inverse());
  out.information = found.information;
  return out;
}

}  // namespace tutti
