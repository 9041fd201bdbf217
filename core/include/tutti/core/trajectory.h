// A trajectory: poses with time stamps, and its file formats.
#pragma once

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

/// Poses in order of strictly growing time stamps.
using Trajectory = std::vector<StampedPose>;

/// How uncertain a motion is: standard deviations, the same on each axis. Of several motions in a row the
/// variances add up.
struct MotionSigma {
  double translation_m = 0;
  double rotation_rad = 0;
  MotionSigma& operator+=(const MotionSigma& next);  ///< another motion follows
};

/// kTum: "stamp tx ty tz qx qy qz qw", '#' comments. kKitti: 12 numbers a line, row-major 3x4, no stamps
/// (the line number is the stamp, unless `times` are read beside it). kEuroc: ASL csv, "ns, p, q(w x y z),
/// ...".
enum class TrajectoryFormat { kTum, kKitti, kEuroc };

/// "tum", "kitti", "euroc" -> format. Throws InputError for another word.
TrajectoryFormat ParseTrajectoryFormat(const std::string& name);

/// What the content looks like (12 columns: KITTI; commas: EuRoC; else TUM). Throws InputError if unreadable.
TrajectoryFormat GuessTrajectoryFormat(const std::filesystem::path& file);

/// Reads a trajectory. Quaternions are normalised. Throws InputError that names file and line for: missing
/// file, wrong number of columns, NaN or infinity, a zero quaternion, time stamps that do not strictly grow.
/// With `warnings`, a pose that repeats the time stamp before it (published ground truth has such lines) is
/// left out instead, the first one stays, and one line about it is appended; another one tells of quaternions
/// whose length is more than 0.1 % off 1. `rotations` gets KITTI's 3x3 matrices as the file has them (6
/// digits: not quite rotations; the poses hold the nearest ones), one per pose; nothing for other formats.
/// `sigmas` gets, from TUM files with two more columns (standard deviations [m] and [deg] of the motion since
/// the pose before), one per pose; nothing from others. Without it such columns are an error.
Trajectory ReadTrajectory(const std::filesystem::path& file, TrajectoryFormat format,
                          std::vector<std::string>* warnings = nullptr,
                          std::vector<Eigen::Matrix3d>* rotations = nullptr,
                          std::vector<MotionSigma>* sigmas = nullptr);

/// Reads standard deviations of a trajectory's motions, a line per pose: [m] and [deg] since the pose before,
/// behind the pose's time stamp if there are three columns. Throws InputError with file and line, also for
/// another number of lines and other time stamps than those of `trajectory`.
std::vector<MotionSigma> ReadMotionSigmas(const std::filesystem::path& file, const Trajectory& trajectory);

/// Reads KITTI's times.txt: one time stamp [s] a line. Throws InputError with file and line.
std::vector<double> ReadTimes(const std::filesystem::path& file);

/// Writes a trajectory, with enough digits to be read back to 1e-9. Throws InputError when the disk is full
/// or the folder can't be written. TUM: stamps with 9 decimals.
void WriteTrajectory(const std::filesystem::path& file, const Trajectory& trajectory,
                     TrajectoryFormat format);

}  // namespace tutti
#pragma GCC visibility pop
