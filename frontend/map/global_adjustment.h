// The work behind GlobalAdjustment.
#pragma once

#include <atomic>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "frontend/map/bundle_adjustment.h"
#include "frontend/map/move_keyframes.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/global_adjustment.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {

class GlobalAdjustment::Work {
 public:
  struct Outcome {
    bool better = false;                       ///< else there is nothing else
    std::vector<Similarity> S_world_keyframe;  ///< of moving(); scale 1 unless it is mono
    std::vector<AdjustedLandmark> landmarks;

    template <class Archive>
    void State(Archive& archive) {
      archive(better, S_world_keyframe, landmarks);
    }
  };

  /// Adjusts the keyframes of one piece; the oldest one stays where it is. `lens`: the camera's error as it
  /// is known, and stays.
  Work(const OdometryOptions& options, const CameraRig& rig, const Map& map, int piece,
       const Eigen::Vector2d& lens, int iterations, bool own_thread);
  /// One that was saved after its end.
  Work(std::vector<int> moving, Outcome outcome);
  ~Work();

  void Cancel() { stop_ = true; }
  /// Waits for the result; on any thread.
  const Outcome& Result() const { return *std::shared_future(outcome_).get(); }
  const std::vector<int>& moving() const { return moving_; }
  /// Waits for the result. Where it moves the keyframes; those of `now` that came since follow the one before
  /// them. None if it found nothing better.
  std::optional<std::map<int, Similarity>> Correction(const Map& now) const;

 private:
  std::vector<int> moving_;
  std::atomic<bool> stop_{false};
  std::shared_future<std::shared_ptr<const Outcome>> outcome_;
};

}  // namespace tutti
