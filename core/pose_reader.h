// Reads a file of poses: its columns, its lines, then the unit of its time stamps. Internal.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/pose_columns.h"
#include "tutti/core/trajectory.h"

namespace tutti::internal {

/// A quaternion of 0, for poses that are positions alone.
inline Eigen::Quaterniond NoRotation() { return Eigen::Quaterniond(0, 0, 0, 0); }

/// One pass over one file.
class PoseReader {
 public:
  /// `tolerant`: repeated stamps are left out. `with_sigmas`: TUM may have columns of them.
  PoseReader(std::filesystem::path file, TrajectoryFormat format, bool tolerant, bool with_sigmas)
      : file_(std::move(file)), format_(format), tolerant_(tolerant), with_sigmas_(with_sigmas) {}

  /// Errors and arguments as ReadTrajectory.
  Trajectory Read(StampUnit expected, TrajectoryDetails& details);
  /// What was put up with, after Read.
  std::vector<std::string> Warnings(const TrajectoryDetails& details, StampUnit expected) const;

 private:
  struct Row {
    std::size_t line = 0;
    std::string stamp;
    double value = 0;  // of the stamp, or the frame's number
    Pose pose;
    Eigen::Matrix3d rotation;
    MotionSigma sigma;
  };
  // Poses that are put up with.
  struct Tolerated {
    std::size_t count = 0, first_line = 0;
    void Note(std::size_t line) {
      if (count++ == 0) first_line = line;
    }
  };

  bool TakeNames(const std::string& text);
  void Take(std::size_t line, const std::vector<std::string>& words);
  void Begin(const std::vector<std::string>& second);
  void Use(std::size_t line, const std::vector<std::string>& words);
  Pose PoseOf(std::size_t line, const std::vector<std::string>& words);
  void TakeMatrix(std::size_t line, const std::vector<std::string>& words, Row& row) const;
  void CheckRotations() const;
  void FindUnit(StampUnit expected, TrajectoryDetails& details) const;
  Trajectory Finish(TrajectoryDetails& details);
  bool LeaveOut(std::size_t line, const Trajectory& before, double stamp_s);
  StampUnit UsualUnit() const;

  const std::filesystem::path file_;
  const TrajectoryFormat format_;
  const bool tolerant_, with_sigmas_;
  Tolerated repeats_;  // of a time stamp, left out
  Tolerated lengths_;  // of quaternions, not 1, normalised
  std::optional<PoseColumns> names_, columns_;
  bool must_fit_ = false;           // names_ are from a line that is no comment
  std::vector<std::string> first_;  // line of numbers
  std::size_t first_line_ = 0;
  std::vector<Row> rows_;
};

}  // namespace tutti::internal
