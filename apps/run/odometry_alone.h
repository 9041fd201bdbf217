// The odometry as it would be if no loop had ever reached it, beside a run with loops.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <future>

#include "tutti/frontend/frame.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

/// A copy of the odometry from before loops changed it for the first time (SlamListeners::on_change),
/// which tracks what comes after. Features need nothing from before: it takes the run's own with the frames.
/// With `own_thread` it tracks beside the run, one frame after the other, else within Track(); the result is
/// the same.
class OdometryAlone {
 public:
  /// `last`: index of the last input frame that the odometry has seen, -1 for none.
  OdometryAlone(const Odometry& odometry, std::int64_t last, bool own_thread);
  ~OdometryAlone();
  OdometryAlone(const OdometryAlone&) = delete;
  OdometryAlone& operator=(const OdometryAlone&) = delete;

  /// The next frame; nothing happens with one that it has seen. Waits while kMostWaiting frames do. Rethrows
  /// what tracking threw.
  void Track(const InputFrame& frame);
  /// When everything is tracked; the next Track() may change it. Rethrows what tracking threw.
  const Odometry& Tracked() {
    Wait(0);
    return odometry_;
  }
  /// After the last frame: mapping that is under way comes in.
  void Finish();

  std::int64_t last() const { return last_; }
  /// Processor time that tracking and mapping have taken so far.
  double CpuSeconds() const { return cpu_s_; }

  static constexpr std::size_t kMostWaiting = 8;

 private:
  void Do(const InputFrame& frame);
  // Until no more than `most` frames wait.
  void Wait(std::size_t most);

  Odometry odometry_;
  std::int64_t last_;
  bool own_thread_;
  std::atomic<double> cpu_s_ = 0;
  std::atomic<bool> stop_ = false;
  std::deque<std::shared_future<void>> waiting_;  // each after the one before it; last: they use the others
};

}  // namespace tutti
