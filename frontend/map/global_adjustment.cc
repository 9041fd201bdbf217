#include "frontend/map/global_adjustment.h"

#include <utility>

namespace tutti {
namespace {
constexpr int kIterations = 5;
constexpr int kMinLandmarks = 20;  // a keyframe with fewer follows its neighbours
}  // namespace

GlobalAdjustment::Work::Work(const OdometryOptions& odometry, const CameraRig& rig, const Map& map, int piece,
                             const Eigen::Vector2d& lens, bool own_thread)
    : metric_(rig.sensor != Sensor::kMono) {
  std::vector<int> fixed;
  for (int id = 0; id < map.KeyframeCount(); ++id) {
    if (map.keyframe(id).piece != piece || map.LandmarksOf({id}).size() < kMinLandmarks) continue;
    (fixed.empty() ? fixed : moving_).push_back(id);
  }
  BundleAdjustmentOptions options;
  options.iterations = kIterations;
  options.pixel_sigma = odometry.pixel_sigma;
  options.metric = metric_;
  options.lens.value = lens;
  options.stop = &stop_;
  const auto work = [this, camera = rig.camera, options, fixed = std::move(fixed)](Map before) {
    auto outcome = std::make_shared<Outcome>(Outcome{before, std::move(before), {}});
    outcome->report = AdjustWindow(camera, moving_, fixed, options, &outcome->after);
    return std::shared_ptr<const Outcome>(std::move(outcome));
  };
  outcome_ = std::async(own_thread ? std::launch::async : std::launch::deferred, work, map).share();
}

GlobalAdjustment::Work::~Work() {
  stop_ = true;  // what was put off and never asked for is not done at all
}

std::optional<std::map<int, Similarity>> GlobalAdjustment::Work::Correction(const Map& now) const {
  const Outcome& outcome = Result();
  if (!outcome.report.usable || !(outcome.report.final_cost < outcome.report.initial_cost))
    return std::nullopt;
  std::map<int, Similarity> S_world_keyframe;
  for (int id : moving_) {
    Similarity S(outcome.after.keyframe(id).T_world_camera);
    if (!metric_) {
      const double before = outcome.before.MedianDepth(id), after = outcome.after.MedianDepth(id);
      if (before > 0 && after > 0) S.scale = after / before;
    }
    S_world_keyframe[id] = S;
  }
  for (int id = 1; id < now.KeyframeCount(); ++id) {
    const Keyframe &last = now.keyframe(id - 1), &next = now.keyframe(id);
    const auto moved = S_world_keyframe.find(id - 1);
    if (moved == S_world_keyframe.end() || next.piece != last.piece) continue;
    const Pose T_last_next = last.T_world_camera.Inverse() * next.T_world_camera;
    S_world_keyframe.emplace(id, moved->second * Similarity(T_last_next));
  }
  return S_world_keyframe;
}

GlobalAdjustment::GlobalAdjustment(std::unique_ptr<Work> work) : work_(std::move(work)) {}
GlobalAdjustment::GlobalAdjustment(GlobalAdjustment&&) noexcept = default;
GlobalAdjustment& GlobalAdjustment::operator=(GlobalAdjustment&&) noexcept = default;
GlobalAdjustment::~GlobalAdjustment() = default;

void GlobalAdjustment::Cancel() { work_->Cancel(); }
int GlobalAdjustment::Keyframes() const { return static_cast<int>(work_->moving().size()); }

}  // namespace tutti
