// Which column of a text file of poses holds what: by its first line, or by the numbers themselves. Internal.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tutti/core/trajectory.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// Places in a line, from 0; -1: there is no such column.
struct PoseColumns {
  static constexpr int kNone = -1;
  int stamp = kNone, number = kNone;  ///< number: of the frame, or of the line
  std::array<int, 3> position = {kNone, kNone, kNone};
  std::array<int, 4> quaternion = {kNone, kNone, kNone, kNone};  ///< x, y, z, w
  int matrix = kNone;                                            ///< the first of 3 x 4 or 4 x 4, by rows
  int sigmas = kNone;                                            ///< the first of two
  std::size_t count = 0;                                         ///< of the columns in a line
  bool more = false;                                             ///< lines may be longer
  std::optional<StampUnit> unit;                                 ///< if the stamp's name says it

  bool HasRotation() const { return matrix != kNone || quaternion[0] != kNone; }
  bool ScalarFirst() const { return quaternion[3] != kNone && quaternion[3] < quaternion[0]; }
};

/// The words of a line of poses.
std::vector<std::string> PoseWords(const std::string& line);

/// From a line that names columns ("timestamp tx ty tz qx qy qz qw", "#timestamp [ns],p_RS_R_x [m],..."):
/// nothing if it does not name a time, or a frame's number, and x, y and z.
std::optional<PoseColumns> ColumnsOfNames(const std::string& line);

/// From the first line of numbers and, if there is one, the second, as the format has them. Throws InputError
/// without the file's name if these are not its columns. `with_sigmas`: TUM may have 10.
PoseColumns ColumnsOfNumbers(const std::vector<std::string>& first, const std::vector<std::string>& second,
                             TrajectoryFormat format, bool with_sigmas);

/// The format that a line of numbers without names looks like.
TrajectoryFormat FormatOfNumbers(const std::string& line);

/// What WriteTrajectory puts first in TUM's format, and its lines, for those that write one pose at a time.
constexpr const char* kTumHeader = "# timestamp tx ty tz qx qy qz qw\n";
/// `stamp_ns`: in place of the stamp.
std::string TumLine(const StampedPose& pose, std::optional<std::int64_t> stamp_ns = std::nullopt);

}  // namespace tutti::internal
#pragma GCC visibility pop
