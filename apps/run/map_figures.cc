#include "apps/run/map_figures.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <vector>

#include "core/numbers.h"

namespace tutti {
namespace {

constexpr double kLeastParallax = 1.0 * internal::kRadians;
constexpr int kFewestViews = 3;                        // else a landmark fits what made it
constexpr std::size_t kRun = 3;                        // keyframes on either side of a jump
constexpr std::size_t kLocal = 5, kFewestDepths = 20;  // keyframes of a local scale, landmarks of each

// A landmark, and from where it was seen first and last.
struct Sighting {
  Eigen::Vector3d position;
  int observations = 0;
  Eigen::Vector3d first, last;
  bool seen = false;
};

struct Step {
  double log_depth = 0, log_speed = 0;
};

double Angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

double Mean(const std::vector<Step>& steps, std::size_t begin, std::size_t end, double Step::*field) {
  double sum = 0;
  for (std::size_t i = begin; i < end; ++i) sum += steps[i].*field;
  return sum / static_cast<double>(end - begin);
}

// Depths alone change with the view, and speed with the motion; the scale changes both.
double ScaleJump(const std::vector<Step>& steps) {
  double jump = 0;
  for (std::size_t i = kRun; i + kRun <= steps.size(); ++i) {
    const auto change = [&](double Step::*field) {
      return Mean(steps, i, i + kRun, field) - Mean(steps, i - kRun, i, field);
    };
    const double depth = change(&Step::log_depth), speed = change(&Step::log_speed);
    if (depth * speed > 0) jump = std::max(jump, std::min(std::abs(depth), std::abs(speed)));
  }
  return std::exp(jump);
}

// Of keyframes in a row, the farthest from 1.
double LocalScale(const std::vector<double>& logarithms) {
  double scale = 0;
  for (std::size_t end = kLocal; end <= logarithms.size(); ++end) {
    const auto last = logarithms.begin() + static_cast<std::ptrdiff_t>(end);
    const double here =
        internal::Median(std::vector<double>(last - static_cast<std::ptrdiff_t>(kLocal), last));
    if (std::abs(here) > std::abs(scale)) scale = here;
  }
  return std::exp(scale);
}

}  // namespace

std::vector<int> KeyframesOfLargestSubmap(const Odometry& odometry, const FrameRange& session) {
  std::vector<int> keyframes;
  const std::vector<int> submaps = FramePieces(odometry.map(), session);
  if (submaps.empty()) return keyframes;
  for (const int id : odometry.map().KeyframeIds()) {
    if (odometry.map().keyframe(id).piece == submaps.front() &&
        session.Has(odometry.map().keyframe(id).frame_index) &&
        odometry.map().keyframe(id).T_world_camera.IsFinite())
      keyframes.push_back(id);
  }
  return keyframes;
}

MapFigures MeasureMap(const Odometry& odometry, const FrameRange& session) {
  MapFigures figures;
  std::vector<KeyframeView> views;
  for (const int id : KeyframesOfLargestSubmap(odometry, session)) {
    views.push_back(ViewOf(odometry.map(), id));
    views.back().descriptors.release();
  }
  if (views.empty()) return figures;
  std::unordered_map<int, Sighting> landmarks;
  for (const int id : odometry.map().LandmarkIds()) {
    const Landmark& l = odometry.map().landmark(id);
    if (l.position.allFinite())
      landmarks[id] = {l.position, static_cast<int>(l.observations.size()), {}, {}, false};
  }
  for (const KeyframeView& view : views) {
    for (const int id : view.landmarks) {
      const auto found = landmarks.find(id);
      if (found == landmarks.end()) continue;
      if (!found->second.seen) found->second.first = view.T_world_camera.translation;
      found->second.last = view.T_world_camera.translation;
      found->second.seen = true;
    }
  }
  const PinholeCamera& c = odometry.map().rig().camera;
  std::vector<double> counts, misfits, depth_misfits, log_scales;
  std::vector<Step> steps;
  int still = 0;
  for (std::size_t k = 0; k < views.size(); ++k) {
    const Pose T_camera_world = views[k].T_world_camera.Inverse();
    const Eigen::Vector3d& centre = views[k].T_world_camera.translation;
    std::vector<double> depths, angles, off;
    for (std::size_t f = 0; f < views[k].landmarks.size(); ++f) {
      const auto found = landmarks.find(views[k].landmarks[f]);
      if (found == landmarks.end()) continue;
      const Sighting& landmark = found->second;
      const Eigen::Vector3d p = T_camera_world * landmark.position;
      if (!(p.z() > 0)) continue;
      depths.push_back(p.z());
      const Eigen::Vector3d ray = landmark.position - centre;
      angles.push_back(std::max(Angle(ray, landmark.position - landmark.first),
                                Angle(ray, landmark.position - landmark.last)));
      if (landmark.observations < kFewestViews) continue;
      if (const double inverse = double(views[k].inverse_depth[f]); inverse > 0) {
        depth_misfits.push_back(std::abs(p.z() * inverse - 1));
        off.push_back(std::log(p.z() * inverse));
      }
      const cv::Point2f pixel = views[k].keypoints[f].pt;
      misfits.push_back(std::hypot(c.fx * p.x() / p.z() + c.cx - double(pixel.x),
                                   c.fy * p.y() / p.z() + c.cy - double(pixel.y)));
    }
    counts.push_back(static_cast<double>(depths.size()));
    if (depths.empty()) continue;
    const double depth = internal::Median(std::move(depths));
    if (off.size() >= kFewestDepths) log_scales.push_back(internal::Median(std::move(off)));
    figures.depth[views[k].frame_index] = depth;
    still += internal::Median(std::move(angles)) < kLeastParallax ? 1 : 0;
    if (k == 0) continue;
    const double time = views[k].stamp_s - views[k - 1].stamp_s;
    const double way = (centre - views[k - 1].T_world_camera.translation).norm();
    if (time > 0 && way > 0) steps.push_back({std::log(depth), std::log(way / time)});
  }
  figures.keyframes = static_cast<int>(views.size());
  if (views.empty()) return figures;
  figures.landmarks = internal::Median(std::move(counts));
  figures.misfit_px = internal::Median(std::move(misfits));
  figures.depth_misfit = internal::Median(std::move(depth_misfits));
  figures.without_parallax = still / static_cast<double>(views.size());
  figures.scale_jump = ScaleJump(steps);
  figures.local_scale = LocalScale(log_scales);
  return figures;
}

}  // namespace tutti
