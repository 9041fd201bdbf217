// Mapping of a keyframe beside the tracking of the next frames.
#pragma once

#include <future>
#include <memory>

#include "frontend/map/local_mapper.h"
#include "frontend/map/map.h"
#include "frontend/odometry/stage_times.h"

namespace tutti {

/// The treatment of one keyframe on a copy of the map, on a thread of its own if wanted. Copies share the
/// work.
class BackgroundMapping {
 public:
  struct Outcome {
    Map map;
    LocalMapper mapper;
    StageTimes stages;  // of this keyframe alone
  };

  bool busy() const { return outcome_.valid(); }
  int keyframe() const { return keyframe_; }

  void Start(int keyframe, const Map& map, const LocalMapper& mapper, SpanRecorder* recorder,
             bool own_thread) {
    keyframe_ = keyframe;
    const auto work = [keyframe](Map m, LocalMapper l, SpanRecorder* r) {
      auto outcome = std::make_shared<Outcome>(Outcome{std::move(m), std::move(l), {{}, r}});
      outcome->mapper.Process(keyframe, &outcome->map, &outcome->stages);
      return std::shared_ptr<const Outcome>(std::move(outcome));
    };
    const auto launch = own_thread ? std::launch::async : std::launch::deferred;
    outcome_ = std::async(launch, work, map, mapper, recorder).share();
  }

  /// Waits for it; no longer busy then.
  std::shared_ptr<const Outcome> Take() {
    std::shared_ptr<const Outcome> outcome = outcome_.get();
    outcome_ = {};
    return outcome;
  }

 private:
  int keyframe_ = -1;
  std::shared_future<std::shared_ptr<const Outcome>> outcome_;
};

}  // namespace tutti
