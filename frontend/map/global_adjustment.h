// The work behind GlobalAdjustment.
#pragma once

#include <atomic>
#include <future>
#include <memory>
#include <vector>

#include "frontend/map/bundle_adjustment.h"
#include "frontend/map/map.h"
#include "tutti/frontend/global_adjustment.h"

namespace tutti {

class GlobalAdjustment::Work {
 public:
  struct Outcome {
    Map before, after;
    BundleAdjustmentReport report;
  };

  /// Adjusts the keyframes `moving`, with `fixed` ones as they are.
  Work(const PinholeCamera& camera, const Map& map, std::vector<int> moving, std::vector<int> fixed,
       const BundleAdjustmentOptions& options, bool own_thread);
  ~Work();

  void Cancel() { stop_ = true; }
  /// Waits for the result.
  const Outcome& Result() const { return *outcome_.get(); }
  const std::vector<int>& moving() const { return moving_; }

 private:
  std::vector<int> moving_;
  std::atomic<bool> stop_{false};
  std::shared_future<std::shared_ptr<const Outcome>> outcome_;
};

}  // namespace tutti
