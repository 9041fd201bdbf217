#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "loopclosure/geometry/verification.h"

namespace tutti {
namespace {

// Depth at a pixel: median of the valid among 3x3; 0 where it is unknown or the pixels disagree.
float DepthAt(const cv::Mat& depth_m, const cv::Point2f& pixel, const VerificationOptions& options) {
  constexpr float kMaxDisagreement = 0.05f;
  const int x = static_cast<int>(std::lround(pixel.x));
  const int y = static_cast<int>(std::lround(pixel.y));
  std::array<float, 9> values{};
  std::size_t count = 0;
  for (int r = std::max(0, y - 1); r <= std::min(depth_m.rows - 1, y + 1); ++r) {
    for (int c = std::max(0, x - 1); c <= std::min(depth_m.cols - 1, x + 1); ++c) {
      const float z = depth_m.at<float>(r, c);
      if (std::isfinite(z) && z > options.min_depth_m && z < options.max_depth_m) values[count++] = z;
    }
  }
  if (count < 5) return 0.0f;
  std::sort(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(count));
  if (values[count - 1] - values[0] > kMaxDisagreement * values[0]) return 0.0f;
  return values[count / 2];
}

View::Set MakeSet(const std::vector<cv::KeyPoint>& keypoints, const cv::Mat& descriptors) {
  View::Set set;
  if (keypoints.empty()) return set;  // a dense member's descriptor is of no pixel
  set.pixels.reserve(keypoints.size());
  for (const cv::KeyPoint& keypoint : keypoints) set.pixels.push_back(keypoint.pt);
  set.descriptors = descriptors;
  return set;
}

void LookUpDepth(const LoopQuery& query, const VerificationOptions& options, View::Set& set) {
  if (query.depth_m.empty() || query.depth_m.type() != CV_32FC1 || !query.camera) return;
  const Eigen::Vector3f unknown = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
  if (set.points.empty()) set.points.assign(set.pixels.size(), unknown);
  for (std::size_t i = 0; i < set.pixels.size(); ++i) {
    if (set.points[i].allFinite()) continue;
    const float z = DepthAt(query.depth_m, set.pixels[i], options);
    if (z <= 0.0f) continue;
    const Eigen::Vector3d ray = query.camera->Unproject({set.pixels[i].x, set.pixels[i].y});
    set.points[i] = ray.cast<float>() * z;
  }
}

// The caller counts his features whatever is dropped: their numbers stay with them.
void DropMasked(const cv::Mat& mask, View::Set& set) {
  if (mask.empty()) return;
  View::Set kept;
  const cv::Mat all = set.descriptors.Unpacked();
  cv::Mat descriptors;
  for (std::size_t i = 0; i < set.pixels.size(); ++i) {
    if (IsMasked(mask, set.pixels[i])) continue;
    kept.pixels.push_back(set.pixels[i]);
    descriptors.push_back(all.row(static_cast<int>(i)));
    if (!set.points.empty()) kept.points.push_back(set.points[i]);
    kept.numbers.push_back(static_cast<int>(i));
  }
  if (kept.pixels.size() == set.pixels.size()) return;
  kept.descriptors = descriptors;
  set = std::move(kept);
}

// Of the image; without one (the caller extracts all features) of the camera, or what the features reach
// over.
cv::Size SizeOf(const LoopQuery& query, const std::vector<Features>& members) {
  if (!query.image.empty()) return query.image.size();
  if (query.camera) return {query.camera->width, query.camera->height};
  cv::Point2f most(0, 0);
  for (const Features& features : members) {
    for (const cv::KeyPoint& keypoint : features.keypoints) {
      most.x = std::max(most.x, keypoint.pt.x);
      most.y = std::max(most.y, keypoint.pt.y);
    }
  }
  return {static_cast<int>(std::ceil(most.x)) + 1, static_cast<int>(std::ceil(most.y)) + 1};
}

}  // namespace

View MakeView(const LoopQuery& query, const std::vector<Features>& members,
              const VerificationOptions& options) {
  View view;
  view.id = query.id;
  view.size = SizeOf(query, members);
  view.camera = query.camera;
  view.metric = query.metric;
  view.cameras = query.cameras;
  for (const Features& features : members) {
    view.members.push_back(MakeSet(features.keypoints, features.descriptors));
    if (query.metric) LookUpDepth(query, options, view.members.back());
  }
  // The caller owns its matrix and may write into it later: keep a copy.
  view.caller = MakeSet(query.features.keypoints, query.features.descriptors.clone());
  for (const Eigen::Vector3d& point : query.features.points)
    view.caller.points.push_back(point.cast<float>());
  DropMasked(query.mask, view.caller);
  if (query.metric) LookUpDepth(query, options, view.caller);
  return view;
}

}  // namespace tutti
