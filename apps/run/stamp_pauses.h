// Where a recording stops for a while.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tutti {

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
