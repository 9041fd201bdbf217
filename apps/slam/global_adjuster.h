// When the whole map is adjusted after loops, and when what comes of it enters.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "tutti/frontend/odometry.h"

namespace tutti {

/// One bundle adjustment of everything at a time, begun when loops have moved the map. Its result enters
/// after a number of frames that depends on the map's size alone: whether it was ready before makes no
/// difference.
class GlobalAdjuster {
 public:
  /// Loops have moved the map: what is under way is of no use any more, and a new one begins.
  void MapMoved(const Odometry& odometry, int piece, std::int64_t frame);
  /// One with so many iterations that it converges begins, due at once.
  void Converge(const Odometry& odometry, int piece);
  /// The map is no longer one that can be adjusted.
  void Cancel();

  /// True if there is one whose result should enter by this frame.
  bool Due(std::int64_t frame) const { return running_ && frame >= due_; }
  bool Running() const { return running_.has_value(); }
  /// The one under way; nothing is under way then.
  GlobalAdjustment Take();

  /// A copy of the one under way, for a saved map.
  std::optional<GlobalAdjustment> pending() const { return running_; }
  /// Goes on as if this one were under way.
  void Resume(std::optional<GlobalAdjustment> adjustment) { running_ = std::move(adjustment); }

  /// All but what is under way.
  template <class Archive>
  void State(Archive& archive) {
    archive(due_);
  }

 private:
  std::optional<GlobalAdjustment> running_;
  std::int64_t due_ = 0;                     // number of frames
  std::vector<GlobalAdjustment> cancelled_;  // they end by themselves
};

}  // namespace tutti
