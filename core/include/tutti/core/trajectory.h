// A trajectory: poses with time stamps, and its file formats.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tutti/core/pose.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Pose of a body at a time: T_world_body.
struct StampedPose {
  double stamp_s = 0.0;  ///< time stamp [s]
  Pose pose;             ///< T_world_body
};

/// Poses in order of strictly growing time stamps. Where rotations are not known (a GPS track, a laser
/// tracker's prism), all their quaternions are 0; such a pose moves points as if it did not turn.
using Trajectory = std::vector<StampedPose>;
/// False if the trajectory has positions alone.
bool HasRotations(const Trajectory& trajectory);

/// How uncertain a motion is: standard deviations, the same on each axis. Of several motions in a row the
/// variances add up.
struct MotionSigma {
  double translation_m = 0;
  double rotation_rad = 0;
  MotionSigma& operator+=(const MotionSigma& next);  ///< another motion follows
};

/// kTum: "stamp tx ty tz qx qy qz qw", '#' comments. kKitti: 12 numbers a line, row-major 3x4, no stamps
/// (the line number is the stamp, unless `times` are read beside it); or 4x4; KITTI-360: the frame's number
/// before them. kEuroc: ASL csv, "ns, p, q(w x y z), ...". TUM and EuRoC may lack the quaternion. Columns are
/// parted by blanks, tabs, commas or semicolons. A line before the poses that names them, with or without
/// '#', decides which is which ("t,x,y,z,qw,qx,qy,qz"), whatever the format.
enum class TrajectoryFormat { kTum, kKitti, kEuroc };

/// "tum", "kitti", "euroc" -> format. Throws InputError for another word.
TrajectoryFormat ParseTrajectoryFormat(const std::string& name);

/// What the content looks like (12, 13, 16 or 17 columns: KITTI; commas: EuRoC; else TUM). Throws InputError
/// if unreadable.
TrajectoryFormat GuessTrajectoryFormat(const std::filesystem::path& file);

/// Units of time stamps in files. Their size and their spacing tell it, or the name of their column.
enum class StampUnit { kSeconds, kMilliseconds, kMicroseconds, kNanoseconds };

/// What a file of poses says beside the poses.
struct TrajectoryDetails {
  bool has_stamps = true;                ///< false: the "stamps" are numbers of frames, or of lines from 0
  bool has_numbers = false;              ///< without stamps: the file numbers its frames (KITTI-360)
  StampUnit unit = StampUnit::kSeconds;  ///< of the stamps in the file
  bool unit_is_certain = true;           ///< false: numbers of frames could look like these milliseconds
  std::vector<std::int64_t> stamps_ns;   ///< the stamps as the file has them [ns], which a double may round;
                                         ///< one per pose, or none where one does not fit
  std::vector<Eigen::Matrix3d> rotations_as_written;  ///< KITTI alone: as the file has them (6 digits: not
                                                      ///< quite rotations; the poses hold the nearest ones)
  std::vector<MotionSigma> sigmas;  ///< TUM with two more columns alone, one per pose: standard deviations
                                    ///< [m] and [deg] of the motion since the pose before
};

/// Reads a trajectory. Quaternions are normalised; time stamps in other units become seconds. Throws
/// InputError that names file and line for: missing file, wrong number of columns, NaN or infinity, a zero
/// quaternion among others, time stamps that do not strictly grow. With `warnings`, a pose that repeats the
/// time stamp before it (published ground truth has such lines) is left out instead, the first one stays, and
/// one line about it is appended; others tell of quaternions whose length is more than 0.1 % off 1, and of a
/// unit that is neither the format's nor `expected`, which what belongs to the file has. Without `details`
/// TUM's columns of standard deviations are an error.
Trajectory ReadTrajectory(const std::filesystem::path& file, TrajectoryFormat format,
                          std::vector<std::string>* warnings = nullptr, TrajectoryDetails* details = nullptr,
                          StampUnit expected = StampUnit::kSeconds);

/// Reads standard deviations of a trajectory's motions, a line per pose: [m] and [deg] since the pose before,
/// behind the pose's time stamp if there are three columns. Throws InputError with file and line, also for
/// another number of lines and other time stamps than those of `trajectory`.
std::vector<MotionSigma> ReadMotionSigmas(const std::filesystem::path& file, const Trajectory& trajectory);

/// Reads time stamps, the first number of each line: KITTI's times.txt, TUM's rgb.txt, EuRoC's data.csv. They
/// become seconds; `warnings` gets a line if they were in another unit. Throws InputError with file and line.
std::vector<double> ReadTimes(const std::filesystem::path& file,
                              std::vector<std::string>* warnings = nullptr);

/// Writes a trajectory, with enough digits to be read back to 1e-9. TUM: stamps with 9 decimals. `stamps_ns`:
/// in place of the stamps, if not empty (TrajectoryDetails). Positions alone have quaternions of 0, which
/// KITTI has no room for. Throws InputError when the disk is full, the folder can't be written, or the format
/// can't hold the poses.
void WriteTrajectory(const std::filesystem::path& file, const Trajectory& trajectory, TrajectoryFormat format,
                     const std::vector<std::int64_t>& stamps_ns = {});

}  // namespace tutti
#pragma GCC visibility pop
