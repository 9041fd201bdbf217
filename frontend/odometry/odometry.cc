#include "tutti/frontend/odometry.h"

#include <utility>

#include "frontend/map/global_adjustment.h"
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

Odometry::Odometry(const OdometryOptions& options, const CameraRig& rig, const Execution& execution) {
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
  impl_->UseOwnThreads(execution.own_threads);
  impl_->SetRecorder(execution.recorder);
}

Odometry::Odometry(const Odometry& before, Map map, std::int64_t frame_offset)
    : Odometry(before.impl_->options(), map.rig()) {
  impl_->GoOn(*before.impl_, std::move(map), frame_offset);
}
Odometry::Odometry(const Odometry& before, Locating) : Odometry(before) { impl_->BeginLocalization(); }
Odometry::Odometry(const Odometry& other, const Execution& execution) : Odometry(other) {
  impl_->UseOwnThreads(execution.own_threads);
  impl_->SetRecorder(execution.recorder);
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
  return impl_->Deliver(impl_->Track(frame));
}
TrackResult Odometry::Follow(const InputFrame& frame, const Pose& T_odom_camera) {
  if (!T_odom_camera.IsFinite())
    throw InputError("frame " + std::to_string(frame.index) + ": its pose has a number that is not finite");
  CheckFrame(frame, impl_->rig());
  return impl_->Deliver(impl_->Follow(frame, T_odom_camera));
}
TrackResult Odometry::RelocalizeAt(int keyframe) { return impl_->Deliver(impl_->RelocalizeAt(keyframe)); }

const Map& Odometry::map() const { return impl_->map(); }
std::vector<int> Odometry::FinishMapping() {
  impl_->EnterMapping();
  return impl_->TakeMapped();
}
std::vector<int> Odometry::Correct(const MapCorrection& correction) { return impl_->Correct(correction); }
void Odometry::Replace(Map map) { impl_->Replace(std::move(map)); }
FrameView Odometry::LastView() const { return impl_->LastView(); }
OdometryReport Odometry::Report() const { return impl_->Report(); }

std::optional<Matrix6d> PoseCovariance(const Odometry& odometry) { return odometry.impl_->PoseCovariance(); }

GlobalAdjustment AdjustGlobally(const Odometry& odometry, int piece, int iterations) {
  const Odometry::Impl& impl = *odometry.impl_;
  const AsyncMapper& mapper = impl.mapper();
  return GlobalAdjustment(std::make_shared<GlobalAdjustment::Work>(impl.options(), impl.rig(), mapper.map(),
                                                                   piece, mapper.lens().Remaining().value,
                                                                   iterations, mapper.own_threads()));
}

}  // namespace tutti
