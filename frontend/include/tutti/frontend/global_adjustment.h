// Bundle adjustment of a whole map, beside the tracking.
#pragma once

#include <memory>

#pragma GCC visibility push(default)
namespace tutti {

/// Bundle adjustment over all keyframes of a map as it was at one moment. Made by
/// Odometry::BeginGlobalAdjustment, brought in by Odometry::Enter; in between the odometry goes on.
class GlobalAdjustment {
 public:
  class Work;
  explicit GlobalAdjustment(std::unique_ptr<Work> work);
  GlobalAdjustment(GlobalAdjustment&&) noexcept;
  GlobalAdjustment& operator=(GlobalAdjustment&&) noexcept;
  /// Waits until the work has stopped.
  ~GlobalAdjustment();

  /// It is not wanted any more; returns at once, while the work ends with its present iteration.
  void Cancel();
  /// Keyframes that it moves.
  int Keyframes() const;

 private:
  friend class Odometry;
  std::unique_ptr<Work> work_;
};

}  // namespace tutti
#pragma GCC visibility pop
