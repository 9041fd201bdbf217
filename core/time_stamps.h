// The unit of time stamps, by their size and spacing: for every reader of files and of file names. Internal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tutti/core/trajectory.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// The unit [s]: 1, 1e-3, 1e-6, 1e-9.
double SecondsOf(StampUnit unit);
/// "seconds", "milliseconds", "microseconds", "nanoseconds".
const char* NameOf(StampUnit unit);

/// Where the unit of a list comes from.
struct RecognisedUnit {
  StampUnit unit = StampUnit::kSeconds;
  bool certain = true;  ///< false: numbers of frames could look alike; see FitUnit
};
/// The unit in which the values, in the order of a file, are times since 1970, or else since any start at the
/// rates of cameras and trackers. `expected` holds where its rates are plausible, and where nothing tells.
RecognisedUnit UnitOfStamps(const std::vector<double>& values, StampUnit expected = StampUnit::kSeconds);

/// First and last time [s].
struct TimeSpan {
  double begin_s = 0, end_s = 0;
};
/// Stamps of an uncertain unit, which were taken for milliseconds, become the numbers that they are if so
/// they are of the time of the others rather. Then `warnings` (if there are any) no longer speak of the unit.
void FitUnit(TimeSpan others, Trajectory& poses, TrajectoryDetails& details,
             std::vector<std::string>* warnings);

/// A number as written, in nanoseconds without rounding (beyond them: to the nearest). Nothing if it is no
/// number or does not fit.
std::optional<std::int64_t> NanosecondsOf(std::string_view word, StampUnit unit);
/// Seconds with 9 decimals, from nanoseconds or from seconds.
std::string StampText(std::int64_t nanoseconds);
std::string StampText(double stamp_s);

/// "FILE: its time stamps are in nanoseconds", for a list that should be in `usual`; empty if it is.
std::string UnitNote(const std::string& file, StampUnit unit, StampUnit usual);

/// Time stamps that files are called by.
struct StampsOfNames {
  StampUnit unit = StampUnit::kSeconds;
  std::vector<std::pair<double, std::size_t>> stamps;  ///< [s], ascending, with the place of the name
};
/// Finds the stamps in names without folder and ending: the number in each, between text that all have in
/// common
/// ("frame_1403636579763555584"). Numbers with a point, and whole ones that are too large to count frames,
/// are stamps. Names that are none are left out; empty if two have the same stamp.
StampsOfNames FindStamps(const std::vector<std::string>& names);

}  // namespace tutti::internal
#pragma GCC visibility pop
