// Trajectories in any file format, told apart by their content, with or without time stamps; conversion.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tutti/core/trajectory.h"

#pragma GCC visibility push(default)
namespace tutti {

/// The formats of tutti/core/trajectory.h, and the vertices of a g2o graph, in order of their ids.
enum class PoseFileFormat { kTum, kKitti, kEuroc, kG2o };
/// "tum", "kitti", "euroc", "g2o".
const std::vector<std::string>& PoseFileFormatNames();
/// Throws InputError for another word.
PoseFileFormat ParsePoseFileFormat(const std::string& name);
const char* ToString(PoseFileFormat format);
/// What the content looks like. Throws InputError if it can't be read.
PoseFileFormat GuessPoseFileFormat(const std::filesystem::path& file);

/// What a file holds. Without stamps those of the trajectory are line numbers from 0 (KITTI), or, with
/// `has_numbers`, numbers of frames (KITTI-360) or ids (g2o).
struct PoseFile : TrajectoryDetails {
  PoseFileFormat format = PoseFileFormat::kTum;
  Trajectory trajectory;
  std::vector<std::string> warnings;
};

/// Reads a file of poses. `format`: nothing guesses it. `times_s` gives KITTI's lines (one each), KITTI-360's
/// frames or g2o's ids (the number is the line) their stamps; other formats have their own. A planar g2o
/// graph lies in z = 0; of similarities the scale is dropped. Throws InputError as ReadTrajectory and ReadG2o
/// do, if the times are too few (KITTI: not as many), and for a graph without poses; the message says which
/// format the file looks like if it is not the one that was asked for.
PoseFile ReadPoseFile(const std::filesystem::path& file, std::optional<PoseFileFormat> format = {},
                      const std::vector<double>& times_s = {});

/// Stamps of an uncertain unit (TrajectoryDetails) become those with which the poses are of the time of the
/// others: of the trajectory that they are compared with, or of the images along it. Then the warnings do not
/// speak of it.
void AgreeOnUnit(double others_begin_s, double others_end_s, PoseFile& poses);
void AgreeOnUnit(PoseFile& a, PoseFile& b);

/// Writes poses. g2o: vertices 0, 1, ..., and between neighbours an edge with identity information, since a
/// graph needs edges. KITTI and g2o have no room for time stamps, nor for positions alone. `stamps_ns`: see
/// WriteTrajectory. Throws InputError if it can't be written.
void WritePoseFile(const std::filesystem::path& file, const Trajectory& trajectory, PoseFileFormat format,
                   const std::vector<std::int64_t>& stamps_ns = {});

/// Writes KITTI's times.txt: one time stamp [s] a line. `stamps_ns`: see WriteTrajectory. Throws InputError
/// if it can't be written in full.
void WriteTimes(const std::filesystem::path& file, const Trajectory& trajectory,
                const std::vector<std::int64_t>& stamps_ns = {});

}  // namespace tutti
#pragma GCC visibility pop
