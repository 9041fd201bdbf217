// The odometry as it would be if no loop had ever reached it, beside a run with loops.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>

#include "tutti/frontend/frame.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

/// A copy of the odometry from before loops changed it for the first time (SlamListeners::on_change),
/// which tracks what comes after. Features need nothing from before: it takes the run's own with the frames.
/// With `own_thread` it tracks beside the run, else within Track(); the result is the same.
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
  const Odometry& Tracked();
  /// After the last frame: mapping that is under way comes in.
  void Finish();

  std::int64_t last() const { return last_; }
  /// Processor time that tracking and mapping have taken so far.
  double CpuSeconds();

  static constexpr std::size_t kMostWaiting = 8;

 private:
  void Work();
  void Do(const InputFrame& frame);
  void Wait(std::size_t most);

  Odometry odometry_;
  std::int64_t last_;
  std::mutex mutex_;  // of what follows
  std::condition_variable changed_;
  std::deque<InputFrame> waiting_;  // the first one is being tracked
  std::exception_ptr failure_;
  double cpu_s_ = 0;
  bool stop_ = false;
  std::thread thread_;  // last: it uses the others
};

}  // namespace tutti
