#include "frontend/dataset/regular_clock.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>

#include "core/numbers.h"

namespace tutti {
namespace {

constexpr std::size_t kFewest = 30;     // stamps that show a clock
constexpr std::size_t kSteps = 4;       // that tell the period
constexpr double kWindow = 20;          // ticks on either side that a line is fitted to
constexpr double kLeastJitter = 5e-4;   // standard deviation that is worth a correction [s]
constexpr double kMostJitter = 0.25;    // in ticks, beyond which there is no even clock
constexpr std::size_t kFewestNear = 8;  // stamps in a window

// The line's value at tick n of the points from `first` to before `last`, or the stamp where they are too
// few.
double LineAt(const std::vector<double>& ticks, const std::vector<double>& stamps, std::size_t i,
              std::size_t first, std::size_t last) {
  const double count = static_cast<double>(last - first);
  if (last - first < kFewestNear) return stamps[i];
  double tick = 0, time = 0, tick2 = 0, both = 0;
  for (std::size_t k = first; k < last; ++k) {
    const double n = ticks[k] - ticks[i], t = stamps[k] - stamps[i];
    tick += n;
    time += t;
    tick2 += n * n;
    both += n * t;
  }
  const double spread = count * tick2 - tick * tick;
  if (!(spread > 0)) return stamps[i];
  const double slope = (count * both - tick * time) / spread;
  return stamps[i] + (time - slope * tick) / count;
}

}  // namespace

std::vector<double> RegularTimes(const std::vector<double>& stamps) {
  if (stamps.size() < kFewest) return stamps;
  std::vector<double> periods;  // over some steps, of which jitter is a smaller part
  for (std::size_t i = kSteps; i < stamps.size(); ++i)
    periods.push_back((stamps[i] - stamps[i - kSteps]) / double(kSteps));
  const double period = internal::Median(periods);
  if (!(period > 0)) return stamps;
  std::vector<double> ticks(1, 0.0);
  for (std::size_t i = 1; i < stamps.size(); ++i)
    ticks.push_back(ticks.back() + std::max(1.0, std::round((stamps[i] - stamps[i - 1]) / period)));
  std::vector<double> times(stamps.size());
  std::size_t first = 0, last = 0;
  double squares = 0;
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    while (ticks[first] < ticks[i] - kWindow) ++first;
    while (last < stamps.size() && ticks[last] <= ticks[i] + kWindow) ++last;
    times[i] = LineAt(ticks, stamps, i, first, last);
    squares += (times[i] - stamps[i]) * (times[i] - stamps[i]);
  }
  const double jitter = std::sqrt(squares / static_cast<double>(stamps.size()));
  const bool grows = std::adjacent_find(times.begin(), times.end(), std::greater_equal<>()) == times.end();
  return grows && jitter > kLeastJitter && jitter < kMostJitter * period ? times : stamps;
}

}  // namespace tutti
