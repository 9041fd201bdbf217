#include "frontend/map/global_adjustment.h"

#include <utility>

namespace tutti {

GlobalAdjustment::Work::Work(const PinholeCamera& camera, const Map& map, std::vector<int> moving,
                             std::vector<int> fixed, const BundleAdjustmentOptions& given, bool own_thread)
    : moving_(std::move(moving)) {
  BundleAdjustmentOptions options = given;
  options.stop = &stop_;
  const auto work = [this, camera, options, fixed = std::move(fixed)](Map before) {
    auto outcome = std::make_shared<Outcome>(Outcome{before, std::move(before), {}});
    outcome->report = AdjustWindow(camera, moving_, fixed, options, &outcome->after);
    return std::shared_ptr<const Outcome>(std::move(outcome));
  };
  outcome_ = std::async(own_thread ? std::launch::async : std::launch::deferred, work, map).share();
}

GlobalAdjustment::Work::~Work() {
  stop_ = true;  // what was put off and never asked for is not done at all
}

GlobalAdjustment::GlobalAdjustment(std::unique_ptr<Work> work) : work_(std::move(work)) {}
GlobalAdjustment::GlobalAdjustment(GlobalAdjustment&&) noexcept = default;
GlobalAdjustment& GlobalAdjustment::operator=(GlobalAdjustment&&) noexcept = default;
GlobalAdjustment::~GlobalAdjustment() = default;

void GlobalAdjustment::Cancel() { work_->Cancel(); }
int GlobalAdjustment::Keyframes() const { return static_cast<int>(work_->moving().size()); }

}  // namespace tutti
