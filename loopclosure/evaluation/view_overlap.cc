#include "loopclosure/evaluation/view_overlap.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/numbers.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

constexpr int kGridWide = 24, kGridHigh = 18;
constexpr int kCoarseWidth = 160;       // enough: a cell of the grid is more than six such pixels wide
constexpr float kNear = 0.05f;          // [m]
constexpr float kNearShare = 0.05f;     // of the depth: Kinect's noise, slanted surfaces, the pose's error
constexpr double kLeastDecided = 0.25;  // of the grid

}  // namespace

DepthView::DepthView(const Pose& T_world_camera, const PinholeCamera& camera, const cv::Mat& depth_m)
    : T_world_camera_(T_world_camera) {
  if (camera.width != depth_m.cols || camera.height != depth_m.rows || depth_m.type() != CV_32FC1) {
    throw InputError("a depth image of " + std::to_string(depth_m.cols) + "x" + std::to_string(depth_m.rows) +
                     " does not belong to a camera of " + std::to_string(camera.width) + "x" +
                     std::to_string(camera.height) + " pixels");
  }
  const int step = std::max(1, (depth_m.cols + kCoarseWidth - 1) / kCoarseWidth);
  coarse_.create((depth_m.rows + step - 1) / step, (depth_m.cols + step - 1) / step, CV_32FC1);
  for (int y = 0; y < coarse_.rows; ++y) {
    for (int x = 0; x < coarse_.cols; ++x) {
      const float z = depth_m.at<float>(y * step, x * step);
      coarse_.at<float>(y, x) = std::isfinite(z) && z > 0 ? z : 0.0f;
    }
  }
  const float scale = 1.0f / static_cast<float>(step);
  fx_ = static_cast<float>(camera.fx) * scale, fy_ = static_cast<float>(camera.fy) * scale;
  cx_ = static_cast<float>(camera.cx) * scale, cy_ = static_cast<float>(camera.cy) * scale;
  for (int r = 0; r < kGridHigh; ++r) {
    for (int c = 0; c < kGridWide; ++c) {
      const int x = (2 * c + 1) * coarse_.cols / (2 * kGridWide),
                y = (2 * r + 1) * coarse_.rows / (2 * kGridHigh);
      const float z = coarse_.at<float>(y, x);
      if (z <= 0) continue;
      points_.emplace_back((static_cast<float>(x) - cx_) / fx_ * z, (static_cast<float>(y) - cy_) / fy_ * z,
                           z);
    }
  }
}

// Among the nine depths there, since a pixel may lie beside an edge, or on a surface seen at a slant.
DepthView::Sight DepthView::Look(const Eigen::Vector3f& point) const {
  const float z = point.z();
  if (z <= 0.01f) return Sight::kNotSeen;
  const float u = fx_ * point.x() / z + cx_, v = fy_ * point.y() / z + cy_;
  if (!(u > -0.5f && v > -0.5f && u < static_cast<float>(coarse_.cols) - 0.5f &&
        v < static_cast<float>(coarse_.rows) - 0.5f))
    return Sight::kNotSeen;
  const int x = static_cast<int>(std::lround(u)), y = static_cast<int>(std::lround(v));
  float nearest = 0, farthest = 0;
  for (int r = std::max(0, y - 1); r <= std::min(coarse_.rows - 1, y + 1); ++r) {
    for (int c = std::max(0, x - 1); c <= std::min(coarse_.cols - 1, x + 1); ++c) {
      const float there = coarse_.at<float>(r, c);
      if (there <= 0) continue;
      nearest = nearest > 0 ? std::min(nearest, there) : there;
      farthest = std::max(farthest, there);
    }
  }
  if (farthest <= 0) return Sight::kDoubt;
  const float allowed = kNear + kNearShare * z;
  return z > nearest - allowed && z < farthest + allowed ? Sight::kSeen : Sight::kNotSeen;
}

std::optional<double> DepthView::SeenBy(const DepthView& other) const {
  const Pose T_other_this = other.T_world_camera_.Inverse() * T_world_camera_;
  const Eigen::Matrix3f rotation = T_other_this.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f translation = T_other_this.translation.cast<float>();
  int seen = 0, decided = 0;
  for (const Eigen::Vector3f& point : points_) {
    const Sight sight = other.Look(rotation * point + translation);
    seen += sight == Sight::kSeen ? 1 : 0;
    decided += sight == Sight::kDoubt ? 0 : 1;
  }
  if (decided < kLeastDecided * kGridWide * kGridHigh) return std::nullopt;
  return static_cast<double>(seen) / decided;
}

double DepthView::AngleTo(const DepthView& other) const {
  return (T_world_camera_.Inverse() * other.T_world_camera_).Angle() * kDegrees;
}

std::string OverlapRule::Validate() const {
  if (!(share > 0 && share <= 1)) return "the overlap of a loop must be above 0 and at most 1";
  if (!(ignore_share >= 0 && ignore_share <= share))
    return "the overlap below which there is no loop must be from 0 to that of a loop";
  if (!(exclude_s >= 0)) return "the exclusion time must be 0 s or more";
  return {};
}

LoopGroundTruth LoopsFromOverlap(const std::vector<std::optional<DepthView>>& views,
                                 const std::vector<double>& stamps_s, const OverlapRule& rule) {
  const std::string problem = rule.Validate();
  if (!problem.empty()) throw InputError("ground truth by overlap: " + problem);
  LoopGroundTruth truth(static_cast<int>(views.size()));
  truth.least_overlap = rule.share;
  truth.best_views.resize(views.size());
  for (std::size_t r = 0; r < views.size(); ++r) {
    for (std::size_t c = 0; c < r; ++c) {
      const int row = static_cast<int>(r), column = static_cast<int>(c);
      truth.Set(row, column, LoopLabel::kIgnore);
      if (!views[r] || !views[c] || stamps_s[r] - stamps_s[c] < rule.exclude_s - 1e-6) continue;
      const auto there = views[r]->SeenBy(*views[c]);
      const auto back = there ? views[c]->SeenBy(*views[r]) : std::nullopt;
      if (!back) continue;
      const double overlap = std::max(*there, *back);
      if (overlap < rule.ignore_share) truth.Set(row, column, LoopLabel::kNone);
      if (overlap < rule.share) continue;
      truth.Set(row, column, LoopLabel::kLoop);
      BestView& best = truth.best_views[r];
      if (overlap > best.overlap) best = {column, overlap, views[r]->AngleTo(*views[c])};
    }
  }
  return truth;
}

}  // namespace tutti::internal
