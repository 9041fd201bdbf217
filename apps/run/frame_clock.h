// Plays a recorded sequence by its time stamps.
#pragma once

#include <cstddef>

namespace tutti {

/// A clock that can be waited on; tests have their own.
class FrameClock {
 public:
  virtual ~FrameClock() = default;
  virtual double Now() = 0;                ///< [s], of any origin
  virtual void WaitUntil(double now) = 0;  ///< returns when Now() >= now
};

/// The machine's monotonic clock.
class SteadyFrameClock : public FrameClock {
 public:
  double Now() override;
  void WaitUntil(double now) override;
};

/// Which frame a camera would have delivered last: the first Reach() starts the play, later frames are due by
/// the distance of their stamps from the first one's.
class Playback {
 public:
  explicit Playback(FrameClock& clock) : clock_(clock) {}
  /// Waits until the frame of this stamp [s] is due.
  void Reach(double stamp_s);
  /// True if it is due already; false before the first Reach().
  bool Due(double stamp_s);

 private:
  FrameClock& clock_;
  bool started_ = false;
  double offset_s_ = 0;  // clock minus stamp
};

}  // namespace tutti
