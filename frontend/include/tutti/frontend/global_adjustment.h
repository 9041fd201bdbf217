// Bundle adjustment of a whole map, beside the tracking.
#pragma once

#include <map>
#include <memory>
#include <optional>

#include "tutti/core/pose.h"

#pragma GCC visibility push(default)
namespace tutti {

class Map;
class Odometry;

/// Bundle adjustment over all keyframes of a submap as it was at one moment. Made by AdjustGlobally, brought
/// in by Odometry::Correct; in between the odometry goes on. Copies share the work.
class GlobalAdjustment {
 public:
  class Work;
  explicit GlobalAdjustment(std::shared_ptr<Work> work);
  GlobalAdjustment(const GlobalAdjustment&);
  GlobalAdjustment& operator=(const GlobalAdjustment&);
  GlobalAdjustment(GlobalAdjustment&&) noexcept;
  GlobalAdjustment& operator=(GlobalAdjustment&&) noexcept;
  /// That of the last copy waits until the work has stopped.
  ~GlobalAdjustment();

  /// It and its copies are not wanted any more; returns at once, while the work ends with its present
  /// iteration.
  void Cancel();
  /// Keyframes that it moves.
  int Keyframes() const;
  /// Waits for the result. Where it moves the keyframes; those of `now` that came since follow. None if it
  /// found nothing better.
  std::optional<std::map<int, Similarity>> Correction(const Map& now) const;

 private:
  friend class Odometry;  // whose implementation takes the landmarks
  friend class OdometryFile;
  std::shared_ptr<Work> work_;
};

}  // namespace tutti
#pragma GCC visibility pop
