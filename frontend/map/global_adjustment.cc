#include "frontend/map/global_adjustment.h"

#include <utility>

#include "core/section_file.h"
#include "core/state_archive.h"

namespace tutti {
namespace {

constexpr int kMinLandmarks = 20;  // a keyframe with fewer follows its neighbours

GlobalAdjustment::Work::Outcome MakeOutcome(const Map& before, const Map& after,
                                            const std::vector<int>& moved,
                                            const BundleAdjustmentReport& report, bool metric) {
  GlobalAdjustment::Work::Outcome outcome;
  outcome.better = report.usable && report.final_cost < report.initial_cost;
  if (!outcome.better) return outcome;
  for (const int id : moved) {
    Similarity S(after.keyframe(id).T_world_camera);
    if (!metric) {
      const double old_depth = before.MedianDepth(id), depth = after.MedianDepth(id);
      if (old_depth > 0 && depth > 0) S.scale = depth / old_depth;
    }
    outcome.S_world_keyframe.push_back(S);
  }
  outcome.landmarks = AdjustedLandmarks(before, after);
  return outcome;
}

}  // namespace

GlobalAdjustment::Work::Work(const OdometryOptions& odometry, const CameraRig& rig, const Map& map, int piece,
                             const Eigen::Vector2d& lens, int iterations, bool own_thread) {
  std::vector<int> fixed;
  for (int id = 0; id < map.KeyframeCount(); ++id) {
    if (map.keyframe(id).piece != piece || map.LandmarksOf({id}).size() < kMinLandmarks) continue;
    (fixed.empty() ? fixed : moving_).push_back(id);
  }
  BundleAdjustmentOptions options;
  options.iterations = iterations;
  options.pixel_sigma = odometry.pixel_sigma;
  options.metric = rig.sensor != Sensor::kMono;
  options.lens.value = lens;
  options.stop = &stop_;
  const auto work = [this, camera = rig.camera, options, fixed = std::move(fixed)](const Map& before) {
    Map after = before;
    const BundleAdjustmentReport report = AdjustWindow(camera, moving_, fixed, options, &after);
    return std::make_shared<const Outcome>(MakeOutcome(before, after, moving_, report, options.metric));
  };
  outcome_ = std::async(own_thread ? std::launch::async : std::launch::deferred, work, map).share();
}

GlobalAdjustment::Work::Work(std::vector<int> moving, Outcome outcome) : moving_(std::move(moving)) {
  std::promise<std::shared_ptr<const Outcome>> done;
  done.set_value(std::make_shared<const Outcome>(std::move(outcome)));
  outcome_ = done.get_future().share();
}

GlobalAdjustment::Work::~Work() {
  stop_ = true;  // what was put off and never asked for is not done at all
}

std::optional<std::map<int, Similarity>> GlobalAdjustment::Work::Correction(const Map& now) const {
  const Outcome& outcome = Result();
  if (!outcome.better) return std::nullopt;
  std::map<int, Similarity> S_world_keyframe;
  for (std::size_t i = 0; i < moving_.size(); ++i) S_world_keyframe[moving_[i]] = outcome.S_world_keyframe[i];
  for (int id = 1; id < now.KeyframeCount(); ++id) {
    const Keyframe &last = now.keyframe(id - 1), &next = now.keyframe(id);
    const auto moved = S_world_keyframe.find(id - 1);
    if (moved == S_world_keyframe.end() || next.piece != last.piece) continue;
    const Pose T_last_next = last.T_world_camera.Inverse() * next.T_world_camera;
    S_world_keyframe.emplace(id, moved->second * Similarity(T_last_next));
  }
  return S_world_keyframe;
}

GlobalAdjustment::GlobalAdjustment(std::shared_ptr<Work> work) : work_(std::move(work)) {}
GlobalAdjustment::GlobalAdjustment(const GlobalAdjustment&) = default;
GlobalAdjustment& GlobalAdjustment::operator=(const GlobalAdjustment&) = default;
GlobalAdjustment::GlobalAdjustment(GlobalAdjustment&&) noexcept = default;
GlobalAdjustment& GlobalAdjustment::operator=(GlobalAdjustment&&) noexcept = default;
GlobalAdjustment::~GlobalAdjustment() = default;

void GlobalAdjustment::Cancel() { work_->Cancel(); }
int GlobalAdjustment::Keyframes() const { return static_cast<int>(work_->moving().size()); }

void GlobalAdjustment::SaveSections(
    const std::function<void(std::uint32_t tag, std::string_view bytes)>& sink) const {
  internal::SharedObjectsOut shared;
  internal::StateWriter out(&shared);
  out(work_->moving(), work_->Result());
  sink(Tag(Section::kGlobalAdjustment), out.Take());
}

}  // namespace tutti
