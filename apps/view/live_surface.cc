#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "apps/reconstruct/depth_source.h"
#include "apps/view/live_state.h"

namespace tutti::view {
namespace {

constexpr int kMostStereoWidth = 320;  // [px] of pairs that are matched while the run waits

// CV_32FC1 [m] of any size, 0: none; empty without depth.
cv::Mat DepthOf(const InputFrame& frame, const CameraRig& rig) {
  if (rig.sensor != Sensor::kStereo || frame.right.empty()) return frame.depth_m;
  const double scale = std::min(1.0, static_cast<double>(kMostStereoWidth) / frame.image.cols);
  cv::Mat left, right;
  cv::resize(frame.image, left, {}, scale, scale, cv::INTER_AREA);
  cv::resize(frame.right, right, {}, scale, scale, cv::INTER_AREA);
  return DepthOfPair(left, right, scale * rig.camera.fx, rig.baseline_m);
}

}  // namespace

void SeeSurface(const InputFrame& frame, const CameraRig& rig, LivePoints* points) {
  constexpr double kMostBaselines = 40;  // the depth of a stereo camera is worth little beyond
  const cv::Mat depth = DepthOf(frame, rig);
  if (depth.empty() || frame.image.empty()) return;
  const double most = rig.sensor == Sensor::kStereo ? kMostBaselines * rig.baseline_m
                      : rig.max_depth_m > 0         ? rig.max_depth_m
                                                    : std::numeric_limits<double>::infinity();
  // A lattice with about as many points as are wanted.
  const double step = std::sqrt(static_cast<double>(frame.image.total()) /
                                static_cast<double>(LiveState::kSurfacePerKeyframe));
  const double shrunk = static_cast<double>(depth.cols) / frame.image.cols;
  for (double v = 0.5 * step; v < frame.image.rows; v += step) {
    for (double u = 0.5 * step; u < frame.image.cols; u += step) {
      const int x = static_cast<int>(u), y = static_cast<int>(v);
      const int row = std::min(static_cast<int>(v * shrunk), depth.rows - 1),
                column = std::min(static_cast<int>(u * shrunk), depth.cols - 1);
      const auto z = static_cast<double>(depth.at<float>(row, column));
      if (!(z > 0 && z <= most) || points->surface.size() >= LiveState::kSurfacePerKeyframe) continue;
      points->surface.emplace_back((z * rig.camera.Unproject(Eigen::Vector2d(x, y))).cast<float>());
      points->greys.push_back(frame.image.at<std::uint8_t>(y, x));
    }
  }
}

}  // namespace tutti::view
