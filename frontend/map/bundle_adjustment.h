// Local bundle adjustment: a window of keyframes and the landmarks that they see.
#pragma once

#include <atomic>
#include <optional>
#include <vector>

#include "frontend/geometry/lens_error.h"
#include "tutti/core/camera.h"
#include "tutti/frontend/map.h"

namespace tutti {

struct BundleAdjustmentOptions {
  int keyframes = 12;         ///< keyframes that move: the newest and those most covisible with it
  int fixed_keyframes = 20;   ///< others that see the same landmarks hold the window in place
  int kept_keyframes = 0;     ///< keyframes with smaller ids stay as they are, and keep all that they see
  int kept_landmarks = 0;     ///< landmarks with smaller ids stay where they are
  int iterations = 6;         ///< most Levenberg-Marquardt iterations
  double pixel_sigma = 1.0;   ///< standard deviation of a keypoint at pyramid level 0 [px]
  bool metric = false;        ///< depth measurements fix the scale: one fixed keyframe is enough, else two
  bool only_aligned = false;  ///< views that never fitted their landmark's patch do not count (Map::Doubtful)
  const std::atomic<bool>* stop = nullptr;  ///< ends the adjustment early when it becomes true
  LensError lens;             ///< what is known of the camera's error; as it is: the camera has none
  bool observe_lens = false;  ///< say in the report what the window alone says of it
};

struct BundleAdjustmentReport {
  bool usable = false;
  int keyframes = 0, fixed = 0, landmarks = 0, observations = 0;
  int removed = 0;  ///< observations that do not fit (95 % chi2) and were removed
  double initial_cost = 0, final_cost = 0;
  std::optional<LensError> lens_seen;  ///< with observe_lens: what the window alone says (ObserveLens)
};

/// Adjusts the window around `keyframe`: Huber loss, analytic Jacobians, dense Schur complement, one thread
/// (deterministic). Then removes observations that do not fit and landmarks that are left with fewer than
/// two.
BundleAdjustmentReport AdjustLocally(const PinholeCamera& camera, int keyframe,
                                     const BundleAdjustmentOptions& options, Map* map);

/// The same over a given set of keyframes; `fixed` ones (a subset of none, one or more) do not move.
BundleAdjustmentReport AdjustWindow(const PinholeCamera& camera, const std::vector<int>& moving,
                                    const std::vector<int>& fixed, const BundleAdjustmentOptions& options,
                                    Map* map);

}  // namespace tutti
