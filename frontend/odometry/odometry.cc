#include "tutti/frontend/odometry.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/median.h"
#include "frontend/odometry/odometry_impl.h"
#include "tutti/core/error.h"

namespace tutti {

const char* ToString(TrackingState state) {
  switch (state) {
    case TrackingState::kInitializing:
      return "initialising";
    case TrackingState::kTracking:
      return "tracking";
    case TrackingState::kLost:
      return "lost";
  }
  return "?";
}

std::string OdometryOptions::Validate() const {
  if (features < 100) return "odometry.features must be at least 100";
  if (pyramid_levels < 1 || pyramid_levels > 16) return "odometry.pyramid_levels must be 1 to 16";
  if (!(scale_factor > 1.01 && scale_factor <= 2.0))
    return "odometry.scale_factor must be above 1.01 and at most 2";
  if (fast_threshold < 1 || fast_threshold_min < 1 || fast_threshold_min > fast_threshold) {
    return "odometry.fast_threshold_min must be at least 1 and at most odometry.fast_threshold";
  }
  if (!(lens_sigma >= 0)) return "odometry.lens_sigma must not be negative";
  if (!(aligned_sigma > 0 && aligned_sigma <= 1))
    return "odometry.aligned_sigma must be above 0 and at most 1";
  if (!(stereo_sigma_px > 0) || !(rgbd_inverse_sigma > 0) || !(pixel_sigma > 0))
    return "odometry: every sigma must be positive";
  if (!(max_depth_baselines > 1)) return "odometry.max_depth_baselines must be above 1";
  if (min_inliers < 8) return "odometry.min_inliers must be at least 8";
  if (!(relocalize_s >= 0)) return "odometry.relocalize_s must not be negative";
  if (!(keyframe_inlier_ratio > 0 && keyframe_inlier_ratio < 1))
    return "odometry.keyframe_inlier_ratio must lie between 0 and 1";
  if (!(keyframe_uncovered_ratio > 0 && keyframe_uncovered_ratio <= 1))
    return "odometry.keyframe_uncovered_ratio must be above 0 and at most 1";
  if (!(keyframe_max_interval_s > 0)) return "odometry.keyframe_max_interval_s must be positive";
  if (mapping_delay_frames < 0) return "odometry.mapping_delay_frames must not be negative";
  if (keyframe_min_frames < 0) return "odometry.keyframe_min_frames must not be negative";
  if (local_keyframes < 1 || triangulation_neighbours < 1)
    return "odometry.local_keyframes and triangulation_neighbours must be at least 1";
  if (!(min_parallax_deg > 0)) return "odometry.min_parallax_deg must be positive";
  if (ba_keyframes < 2 || ba_fixed_keyframes < 0 || ba_iterations < 1) {
    return "odometry.ba_keyframes must be at least 2, ba_fixed_keyframes at least 0, ba_iterations at least "
           "1";
  }
  return {};
}

Odometry::Odometry(const OdometryOptions& options, const CameraRig& rig) {
  std::string problem = options.Validate();
  if (problem.empty()) problem = rig.camera.Validate();
  if (problem.empty() && !rig.calibrated)
    problem = "odometry needs a calibrated camera; give camera: fx, fy, cx, cy";
  if (problem.empty() && rig.camera.distortion != Distortion::kNone)
    problem = "odometry needs rectified frames; the rig still has distortion";
  if (problem.empty() && rig.sensor == Sensor::kStereo && !(rig.baseline_m > 0)) {
    problem = "stereo needs a positive camera.baseline_m [m]";
  }
  if (!problem.empty()) throw InputError(problem);
  impl_ = std::make_unique<Impl>(options, rig);
}

Odometry::Odometry(const Odometry& other) : impl_(std::make_unique<Impl>(*other.impl_)) {}
Odometry& Odometry::operator=(const Odometry& other) {
  if (this != &other) impl_ = std::make_unique<Impl>(*other.impl_);
  return *this;
}
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;
Odometry::~Odometry() = default;

std::shared_ptr<const FrameFeatures> Odometry::Extract(const InputFrame& frame) const {
  return std::make_shared<const FrameFeatures>(ExtractFeatures(frame, impl_->rig, impl_->options));
}

TrackResult Odometry::Track(const InputFrame& frame) { return impl_->Track(frame); }

void Odometry::FinishMapping() { impl_->EnterMapping(); }

std::vector<int> Odometry::TakeMapped() { return std::exchange(impl_->mapped, {}); }

void Odometry::UseOwnThreads(bool own_threads) { impl_->own_threads = own_threads; }

std::vector<SeenLandmark> Odometry::SeenLandmarks() const { return impl_->SeenLandmarks(); }

TrackResult Odometry::RelocalizeAt(int keyframe) { return impl_->RelocalizeAt(keyframe); }

std::vector<int> Odometry::KeyframeIds() const {
  std::vector<int> ids;
  ids.reserve(static_cast<std::size_t>(impl_->map().KeyframeCount()));
  for (int id = 0; id < impl_->map().KeyframeCount(); ++id) ids.push_back(id);
  return ids;
}

KeyframeView Odometry::Keyframe(int id) const {
  const tutti::Keyframe& k = impl_->map().keyframe(id);
  KeyframeView view;
  view.id = id;
  view.frame_index = k.frame_index;
  view.stamp_s = k.stamp_s;
  view.map_piece = KeyframePiece(id);
  view.T_world_camera = k.T_world_camera;
  view.keypoints = k.features->keypoints;
  view.descriptors = k.features->descriptors;
  view.landmarks = k.landmarks;
  const Pose T_camera_world = k.T_world_camera.Inverse();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  view.points.assign(k.features->size(), Eigen::Vector3d::Constant(nan));
  for (std::size_t f = 0; f < k.features->size(); ++f) {
    const float inverse = k.features->inverse_depth[f];
    if (k.landmarks[f] >= 0) {
      const Eigen::Vector3d p = T_camera_world * impl_->map().landmark(k.landmarks[f]).position;
      if (p.z() > 0) view.points[f] = p;
    } else if (inverse > 0 && k.features->inverse_depth_sigma[f] < 0.1F * inverse) {
      const cv::Point2f& p = k.features->keypoints[f].pt;
      view.points[f] = impl_->rig.camera.Unproject({p.x, p.y}) / double(inverse);
    }
  }
  return view;
}

Pose Odometry::KeyframePose(int id) const { return impl_->map().keyframe(id).T_world_camera; }
std::int64_t Odometry::KeyframeFrameIndex(int id) const { return impl_->map().keyframe(id).frame_index; }
double Odometry::KeyframeStamp(int id) const { return impl_->map().keyframe(id).stamp_s; }

int Odometry::KeyframePiece(int id) const {
  int piece = impl_->map().keyframe(id).piece;
  for (auto joined = impl_->piece_joined.find(piece); joined != impl_->piece_joined.end();
       joined = impl_->piece_joined.find(piece)) {
    piece = joined->second;
  }
  return piece;
}

std::vector<std::pair<std::pair<int, int>, int>> Odometry::Covisibility(int min_shared) const {
  std::vector<std::pair<std::pair<int, int>, int>> out;
  for (int id = 0; id < impl_->map().KeyframeCount(); ++id) {
    for (const auto& [other, shared] : impl_->map().keyframe(id).covisible) {
      if (other > id && shared >= min_shared) out.push_back({{id, other}, shared});
    }
  }
  return out;
}

std::vector<int> Odometry::Pieces() const {
  std::map<int, int> frames;
  for (const Impl::FrameRecord& r : impl_->records) ++frames[KeyframePiece(r.reference)];
  std::vector<int> pieces;
  pieces.reserve(frames.size());
  for (const auto& [piece, count] : frames) pieces.push_back(piece);
  std::stable_sort(pieces.begin(), pieces.end(), [&](int a, int b) { return frames[a] > frames[b]; });
  return pieces;
}

Trajectory Odometry::FrameTrajectory(int map_piece) const {
  if (map_piece < 0 && !impl_->records.empty()) map_piece = Pieces().front();
  Trajectory out;
  for (const Impl::FrameRecord& r : impl_->records) {
    if (KeyframePiece(r.reference) != map_piece) continue;
    out.push_back({r.stamp_s, impl_->map().keyframe(r.reference).T_world_camera * r.T_reference_frame});
  }
  return out;
}

std::vector<std::int64_t> Odometry::FrameIndices(int map_piece) const {
  if (map_piece < 0 && !impl_->records.empty()) map_piece = Pieces().front();
  std::vector<std::int64_t> out;
  for (const Impl::FrameRecord& r : impl_->records) {
    if (KeyframePiece(r.reference) == map_piece) out.push_back(r.index);
  }
  return out;
}

std::map<std::string, double> Odometry::StageMilliseconds() const { return impl_->stages.milliseconds; }
void Odometry::SetRecorder(SpanRecorder* recorder) { impl_->stages.recorder = recorder; }

double Odometry::StereoRowErrorPx() const { return internal::Median(impl_->row_errors); }
double Odometry::StereoMatches() const { return internal::Median(impl_->stereo_matches); }

}  // namespace tutti
