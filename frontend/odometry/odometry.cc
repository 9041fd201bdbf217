#include "tutti/frontend/odometry.h"

#include <limits>
#include <utility>

#include "core/numbers.h"
#include "frontend/map/global_adjustment.h"
#include "frontend/map/other_camera.h"
#include "frontend/odometry/frame_check.h"
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
  CheckFrame(frame, impl_->rig());
  return std::make_shared<const FrameFeatures>(ExtractFeatures(frame, impl_->rig(), impl_->options()));
}

TrackResult Odometry::Track(const InputFrame& frame) {
  CheckFrame(frame, impl_->rig());
  return impl_->Track(frame);
}
TrackResult Odometry::Follow(const InputFrame& frame, const Pose& T_odom_camera) {
  if (!T_odom_camera.IsFinite())
    throw InputError("frame " + std::to_string(frame.index) + ": its pose has a number that is not finite");
  CheckFrame(frame, impl_->rig());
  return impl_->Follow(frame, T_odom_camera);
}
TrackResult Odometry::RelocalizeAt(int keyframe) { return impl_->RelocalizeAt(keyframe); }
void Odometry::BeginSession(const CameraRig& rig, std::int64_t frame_offset) {
  const std::string problem = OtherCameraProblem(impl_->rig(), rig, impl_->map().scales());
  if (!problem.empty()) throw InputError(problem);
  Odometry next(impl_->options(), rig);
  impl_->EnterMapping();
  next.impl_->GoOn(*impl_, frame_offset);
  *this = std::move(next);
}
void Odometry::Append(const Odometry& other, std::int64_t frame_offset) {
  const std::string problem = OtherCameraProblem(impl_->rig(), other.impl_->rig(), impl_->map().scales());
  if (!problem.empty()) throw InputError(problem);
  if (impl_->map().scales() != other.impl_->map().scales())
    throw InputError(
        "the two maps have other image pyramids (odometry.pyramid_levels, odometry.scale_factor)");
  Odometry joined(impl_->options(), impl_->rig());
  impl_->EnterMapping();
  joined.impl_->GoOn(*impl_, frame_offset);
  joined.impl_->Append(*other.impl_, frame_offset);
  *this = std::move(joined);
}
std::int64_t Odometry::FrameOffset() const { return impl_->frame_offset(); }
int Odometry::SessionPiece() const { return impl_->session_piece(); }
void Odometry::BeginLocalization() { impl_->BeginLocalization(); }
bool Odometry::BeyondMap() const { return impl_->localizer().Beyond(); }
int Odometry::ReferenceKeyframe() const {
  const int of_map = impl_->localizer().keyframe();
  return of_map >= 0 ? of_map : impl_->last().reference;
}
std::optional<Matrix6d> Odometry::PoseCovariance() const { return impl_->PoseCovariance(); }
void Odometry::FinishMapping() { impl_->EnterMapping(); }
std::vector<int> Odometry::TakeMapped() { return impl_->TakeMapped(); }
void Odometry::UseOwnThreads(bool own_threads) { impl_->UseOwnThreads(own_threads); }

std::vector<SeenLandmark> Odometry::SeenLandmarks() const {
  const LastFrame& last = impl_->last();
  std::vector<SeenLandmark> seen;
  for (std::size_t f = 0; f < last.matches.landmarks.size(); ++f) {
    const int landmark = last.matches.landmarks[f];
    if (landmark >= 0) seen.push_back({landmark, last.frame.features->keypoints[f].pt});
  }
  return seen;
}

std::vector<int> Odometry::KeyframeIds() const {
  std::vector<int> ids;
  ids.reserve(static_cast<std::size_t>(impl_->map().KeyframeCount()));
  for (int id = 0; id < impl_->map().KeyframeCount(); ++id) {
    if (impl_->map().keyframe(id).replaced_by < 0) ids.push_back(id);
  }
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
  view.inverse_depth = k.features->inverse_depth;
  view.inverse_depth_sigma = k.features->inverse_depth_sigma;
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
      view.points[f] = impl_->rig().camera.Unproject({p.x, p.y}) / double(inverse);
    }
  }
  return view;
}

Pose Odometry::KeyframePose(int id) const { return impl_->map().keyframe(id).T_world_camera; }
std::int64_t Odometry::KeyframeFrameIndex(int id) const { return impl_->map().keyframe(id).frame_index; }
double Odometry::KeyframeStamp(int id) const { return impl_->map().keyframe(id).stamp_s; }

int Odometry::KeyframePiece(int id) const { return impl_->map().keyframe(id).piece; }

int Odometry::NextKeyframeId() const { return impl_->map().KeyframeCount(); }

int Odometry::LandmarkCount() const {
  int count = 0;
  for (int id = 0; id < impl_->map().LandmarkCount(); ++id) count += impl_->map().landmark(id).alive ? 1 : 0;
  return count;
}

std::vector<LandmarkView> Odometry::Landmarks() const {
  const Map& map = impl_->map();
  std::vector<LandmarkView> landmarks;
  for (int id = 0; id < map.LandmarkCount(); ++id) {
    const Landmark& landmark = map.landmark(id);
    if (landmark.alive && !landmark.observations.empty())
      landmarks.push_back({id, landmark.position, static_cast<int>(landmark.observations.size())});
  }
  return landmarks;
}

const CameraRig& Odometry::Rig() const { return impl_->rig(); }

std::vector<std::pair<std::pair<int, int>, int>> Odometry::Covisibility(int min_shared) const {
  std::vector<std::pair<std::pair<int, int>, int>> out;
  for (int id = 0; id < impl_->map().KeyframeCount(); ++id) {
    for (const auto& [other, shared] : impl_->map().keyframe(id).covisible) {
      if (other > id && shared >= min_shared) out.push_back({{id, other}, shared});
    }
  }
  return out;
}

void Odometry::ApplyCorrection(const std::map<int, Similarity>& S_world_keyframe,
                               const std::map<int, int>& merges) {
  impl_->Correct(S_world_keyframe, merges, nullptr);
}

void Odometry::FuseAll() { impl_->FuseAll(); }

int Odometry::FuseLoop(int older, int newer, const Similarity& S_older_newer) {
  return impl_->FuseLoop(older, newer, S_older_newer);
}

std::map<int, int> Odometry::RemoveRedundantKeyframes(const std::function<bool(int removed, int into)>& may) {
  return impl_->RemoveRedundantKeyframes(may);
}

GlobalAdjustment Odometry::BeginGlobalAdjustment(int piece, int iterations) const {
  const AsyncMapper& mapper = impl_->mapper();
  return GlobalAdjustment(std::make_shared<GlobalAdjustment::Work>(
      impl_->options(), impl_->rig(), mapper.map(), piece, mapper.lens().Remaining().value, iterations,
      mapper.own_threads()));
}

std::optional<std::map<int, Similarity>> Odometry::CorrectionOf(const GlobalAdjustment& adjustment) const {
  return adjustment.work_->Correction(impl_->map());
}

void Odometry::Enter(const GlobalAdjustment& adjustment, const std::map<int, Similarity>& S_world_keyframe) {
  impl_->Correct(S_world_keyframe, {}, adjustment.work_.get());
}

std::vector<int> Odometry::Pieces(const FrameRange& range) const {
  return impl_->history().Pieces(impl_->map(), range);
}

Trajectory Odometry::FrameTrajectory(int map_piece, const FrameRange& range) const {
  return impl_->history().Poses(impl_->map(), map_piece, range);
}

std::vector<std::int64_t> Odometry::FrameIndices(int map_piece, const FrameRange& range) const {
  return impl_->history().Indices(impl_->map(), map_piece, range);
}

std::map<std::string, double> Odometry::StageMilliseconds() const { return impl_->stages().milliseconds; }
void Odometry::SetRecorder(SpanRecorder* recorder) { impl_->SetRecorder(recorder); }

double Odometry::StereoRowErrorPx() const { return internal::Median(impl_->row_errors()); }
double Odometry::StereoMatches() const { return internal::Median(impl_->stereo_matches()); }

std::optional<HeightFound> Odometry::Height() const { return impl_->height().Found(); }
std::optional<LensFound> Odometry::Lens() const {
  const SelfCalibration& lens = impl_->mapper().lens();
  return lens.Enabled() ? std::optional(lens.Found()) : std::nullopt;
}

}  // namespace tutti
