// Frames by their time stamps: played as a camera would have given them, and where a recording stops.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tutti {

/// The machine's monotonic clock; tests have their own.
class FrameClock {
 public:
  virtual ~FrameClock() = default;
  virtual double Now();                ///< [s], of any origin
  virtual void WaitUntil(double now);  ///< returns when Now() >= now
};

/// Which frame a camera would have delivered last: the first Reach() starts the play, later frames are due by
/// the distance of their stamps from the first one's.
class Playback {
 public:
  explicit Playback(std::shared_ptr<FrameClock> clock) : clock_(std::move(clock)) {}
  /// Waits until the frame of this stamp [s] is due.
  void Reach(double stamp_s);
  /// True if it is due already; false before the first Reach().
  bool Due(double stamp_s) { return offset_s_ && clock_->Now() >= stamp_s + *offset_s_; }

 private:
  std::shared_ptr<FrameClock> clock_;
  std::optional<double> offset_s_;  // clock minus stamp
};

/// Looks for frames that come long after the one before them: a camera that stalls, a clock that is set, a
/// recording that was put together.
class StampPauses {
 public:
  /// A sentence about the time before this frame, if it is longer than 10 s and than 20 times what is usual
  /// among the last frames.
  std::optional<std::string> Next(std::int64_t frame, double stamp_s);

 private:
  std::optional<double> before_s_;
  std::vector<double> intervals_s_;  // the last ones, in no order
  std::size_t oldest_ = 0;
};

}  // namespace tutti
