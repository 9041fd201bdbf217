#include "frontend/odometry/async_mapper.h"

namespace tutti {
namespace {
constexpr int kDepthLandmarks = 100;  // by the depth of a keyframe at least, however far they are
}

AsyncMapper::AsyncMapper(const OdometryOptions& options, const CameraRig& rig)
    : delay_frames_(options.mapping_delay_frames),
      has_depth_(rig.sensor != Sensor::kMono),
      map_(PyramidScales(options), rig, options.aligned_sigma),
      mapper_(options, rig) {}

int AsyncMapper::AddKeyframe(const TrackedFrame& frame, int piece, const Pose& T_world_camera,
                             const std::vector<int>& landmarks) {
  assert(!Busy());
  Keyframe k;
  k.frame_index = frame.index;
  k.stamp_s = frame.stamp_s;
  k.piece = piece;
  k.features = frame.features;
  k.T_world_camera = T_world_camera;
  const int id = map_.AddKeyframe(std::move(k));
  for (std::size_t f = 0; f < landmarks.size(); ++f) {
    const int l = landmarks[f];
    if (l >= 0 && std::as_const(map_).landmark(l).alive) map_.AddObservation(l, id, static_cast<int>(f));
  }
  if (has_depth_) mapper_.AddDepthLandmarks(id, kDepthLandmarks, &map_);
  return id;
}

void AsyncMapper::Start(int keyframe, const StageTimes& stages) {
  assert(!Busy());
  const auto work = [keyframe](Map map, LocalMapper mapper, SpanRecorder* recorder) {
    auto outcome = std::make_shared<Outcome>(Outcome{std::move(map), std::move(mapper), {{}, recorder}});
    outcome->mapper.Process(keyframe, &outcome->map, &outcome->stages);
    return std::shared_ptr<const Outcome>(std::move(outcome));
  };
  const auto launch = own_threads_ ? std::launch::async : std::launch::deferred;
  outcome_ = std::async(launch, work, map_, mapper_, stages.recorder).share();
  keyframe_ = keyframe;
  frames_ = 0;
}

void AsyncMapper::Enter(StageTimes* stages) {
  {
    const ScopedSpan span(stages->recorder, Lane::kTracking, "wait_for_mapping");
    const std::shared_ptr<const Outcome> outcome = std::exchange(outcome_, {}).get();
    Map entered = outcome->map;
    entered.TakeFrames(map_);
    map_ = std::move(entered);
    mapper_ = outcome->mapper;
    for (const auto& [stage, ms] : outcome->stages.milliseconds) stages->milliseconds[stage] += ms;
  }
  mapped_.push_back(keyframe_);
  Count(&visible_, &Landmark::visible);
  Count(&found_, &Landmark::found);
}

void AsyncMapper::Resume(const StageTimes& stages) {
  if (!std::exchange(interrupted_, false)) return;
  const int frames = frames_;
  Start(keyframe_, stages);
  frames_ = frames;
}

void AsyncMapper::CountSeen(const PoseFix& fix) {
  visible_.insert(visible_.end(), fix.visible.begin(), fix.visible.end());
  found_.insert(found_.end(), fix.found.begin(), fix.found.end());
  if (Busy()) return;
  Count(&visible_, &Landmark::visible);
  Count(&found_, &Landmark::found);
}

// By what the landmarks have become meanwhile.
void AsyncMapper::Count(std::vector<int>* landmarks, int Landmark::*counter) {
  for (int l : *landmarks) {
    const int present = std::as_const(map_).Present(l);
    if (present >= 0) ++(map_.landmark(present).*counter);
  }
  landmarks->clear();
}

}  // namespace tutti
