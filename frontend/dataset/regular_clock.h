// The clock of a camera behind time stamps that jitter. Internal.
#pragma once

#include <vector>

namespace tutti {

/// Times at which a clock that ticks evenly for about a second took the images of these ascending stamps [s]:
/// a line through the stamps around each. The stamps themselves where they have no such clock, or do not
/// jitter.
std::vector<double> RegularTimes(const std::vector<double>& stamps);

}  // namespace tutti
