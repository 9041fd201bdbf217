// What loops do to the map: keyframes move, landmarks are found to be one, everything is adjusted.
#include <algorithm>

#include "frontend/map/global_adjustment.h"
#include "frontend/map/landmark_fusion.h"
#include "frontend/odometry/odometry_impl.h"

namespace tutti {
namespace {

constexpr int kIterations = 5;     // of a global bundle adjustment
constexpr int kMinLandmarks = 20;  // a keyframe with fewer follows its neighbours

}  // namespace

void Odometry::ApplyCorrection(const std::map<int, Similarity>& S_world_keyframe,
                               const std::map<int, int>& merges) {
  impl_->EnterMapping();
  impl_->MoveMap(S_world_keyframe);
  impl_->UpdateGeometry();
  for (const auto& [from, to] : merges) {
    if (from != to) impl_->piece_joined[from] = to;
  }
}

void Odometry::Impl::UpdateGeometry() {
  for (int l = 0; l < map().LandmarkCount(); ++l) {
    if (map().landmark(l).alive) map_.UpdateGeometry(l);
  }
}

void Odometry::Impl::MoveMap(const std::map<int, Similarity>& S_world_keyframe) {
  std::vector<Pose> old_T_camera_world;
  std::vector<Similarity> corrected;
  for (int id = 0; id < map().KeyframeCount(); ++id) {
    const Pose& T_world_camera = map().keyframe(id).T_world_camera;
    old_T_camera_world.push_back(T_world_camera.Inverse());
    const auto it = S_world_keyframe.find(id);
    corrected.push_back(it != S_world_keyframe.end() ? it->second : Similarity(T_world_camera));
  }
  for (int l = 0; l < map().LandmarkCount(); ++l) {
    if (!map().landmark(l).alive) continue;
    Landmark& landmark = map_.landmark(l);
    const std::size_t r = static_cast<std::size_t>(landmark.reference);
    landmark.position = corrected[r] * (old_T_camera_world[r] * landmark.position);
  }
  if (reference_ >= 0) {
    const std::size_t r = static_cast<std::size_t>(reference_);
    MoveCurrent(old_T_camera_world[r].Inverse(), corrected[r]);
  }
  for (FrameRecord& record : records) {
    record.T_reference_frame.translation *= corrected[static_cast<std::size_t>(record.reference)].scale;
  }
  for (std::size_t k = 0; k < corrected.size(); ++k)
    map_.keyframe(static_cast<int>(k)).T_world_camera = corrected[k].RigidPart();
}

int Odometry::FuseLoop(int older, int newer, const Similarity& S_older_newer) {
  return tutti::FuseLoop(impl_->rig.camera, older, newer, S_older_newer.RigidPart(), &impl_->WritableMap());
}

GlobalAdjustment Odometry::BeginGlobalAdjustment(int piece) const {
  std::vector<int> moving, fixed;
  for (int id = 0; id < impl_->map().KeyframeCount(); ++id) {
    if (KeyframePiece(id) != piece || impl_->map().LandmarksOf({id}).size() < kMinLandmarks) continue;
    (fixed.empty() ? fixed : moving).push_back(id);
  }
  BundleAdjustmentOptions options;
  options.iterations = kIterations;
  options.pixel_sigma = impl_->options.pixel_sigma;
  options.metric = impl_->rig.sensor != Sensor::kMono;
  options.lens.value = impl_->Lens().value;  // and stays that
  return GlobalAdjustment(std::make_unique<GlobalAdjustment::Work>(impl_->rig.camera, impl_->map(), moving,
                                                                   fixed, options, impl_->own_threads));
}

std::optional<std::map<int, Similarity>> Odometry::CorrectionOf(const GlobalAdjustment& adjustment) const {
  const GlobalAdjustment::Work::Outcome& outcome = adjustment.work_->Result();
  if (!outcome.report.usable || !(outcome.report.final_cost < outcome.report.initial_cost))
    return std::nullopt;
  std::map<int, Similarity> S_world_keyframe;
  for (int id : adjustment.work_->moving()) {
    Similarity S(outcome.after.keyframe(id).T_world_camera);
    if (impl_->rig.sensor == Sensor::kMono) {
      const double before = outcome.before.MedianDepth(id), after = outcome.after.MedianDepth(id);
      if (before > 0 && after > 0) S.scale = after / before;
    }
    S_world_keyframe[id] = S;
  }
  // The others follow the keyframe before them.
  const Map& now = impl_->map();
  for (int id = 1; id < now.KeyframeCount(); ++id) {
    const auto before = S_world_keyframe.find(id - 1);
    if (before == S_world_keyframe.end() || KeyframePiece(id) != KeyframePiece(id - 1)) continue;
    const Pose T_before_this =
        now.keyframe(id - 1).T_world_camera.Inverse() * now.keyframe(id).T_world_camera;
    S_world_keyframe.emplace(id, before->second * Similarity(T_before_this));
  }
  return S_world_keyframe;
}

void Odometry::Enter(const GlobalAdjustment& adjustment, const std::map<int, Similarity>& S_world_keyframe) {
  impl_->EnterMapping();
  impl_->MoveMap(S_world_keyframe);
  const GlobalAdjustment::Work::Outcome& outcome = adjustment.work_->Result();
  for (int l = 0; l < outcome.after.LandmarkCount(); ++l) {
    impl_->TakeAdjusted(l, outcome.before.landmark(l), outcome.after.landmark(l));
  }
  impl_->UpdateGeometry();
}

// A landmark's new place, without the views that do not fit it.
void Odometry::Impl::TakeAdjusted(int id, const Landmark& before, const Landmark& after) {
  if (!before.alive || !map().landmark(id).alive) return;
  if (!after.alive) {
    map_.RemoveLandmark(id);
    return;
  }
  if (after.position != before.position) map_.landmark(id).position = after.position;
  for (const Observation& o : before.observations) {
    const bool stays = std::any_of(after.observations.begin(), after.observations.end(),
                                   [&](const Observation& other) { return other.keyframe == o.keyframe; });
    if (!stays) map_.RemoveObservation(id, o.keyframe);
  }
}

}  // namespace tutti
