#include "tutti/backend/trajectory_file.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>

#include "core/replaced_file.h"
#include "core/text_reader.h"
#include "core/time_stamps.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

static_assert(static_cast<int>(PoseFileFormat::kTum) == static_cast<int>(TrajectoryFormat::kTum) &&
              static_cast<int>(PoseFileFormat::kKitti) == static_cast<int>(TrajectoryFormat::kKitti) &&
              static_cast<int>(PoseFileFormat::kEuroc) == static_cast<int>(TrajectoryFormat::kEuroc));

/// For all but kG2o.
TrajectoryFormat CoreFormat(PoseFileFormat format) { return static_cast<TrajectoryFormat>(format); }

/// The first word that carries data; empty if there is none.
std::string FirstWord(const std::filesystem::path& file) {
  internal::TextReader in(file);
  std::string text;
  while (in.Next(text)) {
    const std::vector<std::string> words = SplitText(text);
    if (!words.empty() && words[0][0] != '#') return words[0];
  }
  return {};
}

Trajectory GraphTrajectory(const std::filesystem::path& file, std::vector<std::string>& warnings) {
  G2oFile graph = ReadG2o(file, BadInformation::kRefuse, true);  // the poses alone count
  warnings = graph.warnings;
  if (!graph.has_all_vertices) {
    throw InputError(file.string() +
                     ": holds edges without poses for all of their ends; `tutti optimize` finds the poses");
  }
  constexpr NodeId kLargest = NodeId{1} << 53;  // of the whole numbers that a double holds
  const std::map<NodeId, Similarity> poses = graph.graph.Poses();
  const bool large = !poses.empty() && (poses.rbegin()->first > kLargest || poses.begin()->first < -kLargest);
  if (large)
    warnings.push_back(
        file.string() +
        ": its ids are too large for time stamps; its poses count as 0, 1, 2, ... by their ids");
  Trajectory out;
  for (const auto& [id, pose] : poses)
    out.push_back({large ? static_cast<double>(out.size()) : static_cast<double>(id), pose.RigidPart()});
  return out;
}

void GiveStamps(const std::filesystem::path& file, const std::vector<double>& times, PoseFile& out) {
  if (!out.has_numbers && times.size() != out.trajectory.size()) {
    throw InputError(file.string() + ": has " + std::to_string(out.trajectory.size()) +
                     " poses, but there are " + std::to_string(times.size()) +
                     " time stamps; KITTI's times.txt has one line per pose");
  }
  for (StampedPose& pose : out.trajectory) {
    if (!(pose.stamp_s >= 0 && pose.stamp_s < static_cast<double>(times.size()))) {
      throw InputError(file.string() + (out.format == PoseFileFormat::kG2o ? ": vertex " : ": frame ") +
                       std::to_string(static_cast<long long>(pose.stamp_s)) +
                       " has no time stamp, there are " + std::to_string(times.size()) +
                       "; its number is its line in the file of times, from 0");
    }
    pose.stamp_s = times[static_cast<std::size_t>(pose.stamp_s)];
  }
  for (std::size_t k = 1; k < out.trajectory.size(); ++k) {
    if (!(out.trajectory[k - 1].stamp_s < out.trajectory[k].stamp_s))
      throw InputError(file.string() + ": the time stamps given for it do not grow at pose " +
                       std::to_string(k) + ", counted from 0");
  }
  out.has_stamps = true;
}

PoseFile ReadAs(const std::filesystem::path& file, PoseFileFormat format, const std::vector<double>& times) {
  PoseFile out;
  out.format = format;
  if (format == PoseFileFormat::kG2o) {
    out.trajectory = GraphTrajectory(file, out.warnings);
    out.has_stamps = false;
    out.has_numbers = true;
  } else {
    out.trajectory = ReadTrajectory(file, CoreFormat(format), &out.warnings, &out);
  }
  if (!out.has_stamps && !times.empty()) GiveStamps(file, times, out);
  return out;
}

}  // namespace

const std::vector<std::string>& PoseFileFormatNames() {
  static const std::vector<std::string> names = {"tum", "kitti", "euroc", "g2o"};
  return names;
}

PoseFileFormat ParsePoseFileFormat(const std::string& name) {
  const std::vector<std::string>& names = PoseFileFormatNames();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw InputError("unknown trajectory format '" + name + "'; use tum, kitti, euroc or g2o");
  return static_cast<PoseFileFormat>(found - names.begin());
}

const char* ToString(PoseFileFormat format) {
  return PoseFileFormatNames().at(static_cast<std::size_t>(format)).c_str();
}

PoseFileFormat GuessPoseFileFormat(const std::filesystem::path& file) {
  // First, as a planar edge has as many words as a line of KITTI.
  const std::string word = FirstWord(file);
  if (word == "FIX" || word.rfind("VERTEX", 0) == 0 || word.rfind("EDGE", 0) == 0 ||
      word.rfind("PARAMS", 0) == 0)
    return PoseFileFormat::kG2o;
  return static_cast<PoseFileFormat>(GuessTrajectoryFormat(file));
}

PoseFile ReadPoseFile(const std::filesystem::path& file, std::optional<PoseFileFormat> format,
                      const std::vector<double>& times_s) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored))
    throw InputError(file.string() + ": is a folder; give a file");
  const PoseFileFormat guess = GuessPoseFileFormat(file);
  try {
    return ReadAs(file, format.value_or(guess), times_s);
  } catch (const InputError& error) {
    // A file in another format fails in its first line; say so instead of complaining about columns alone.
    if (!format || *format == guess) throw;
    throw InputError(std::string(error.what()) + " (it looks like the format " + ToString(guess) + ")");
  }
}

void AgreeOnUnit(double others_begin_s, double others_end_s, PoseFile& poses) {
  internal::FitUnit({others_begin_s, others_end_s}, poses.trajectory, poses, &poses.warnings);
}

void AgreeOnUnit(PoseFile& a, PoseFile& b) {
  const double begin_s = a.trajectory.front().stamp_s, end_s = a.trajectory.back().stamp_s;
  AgreeOnUnit(b.trajectory.front().stamp_s, b.trajectory.back().stamp_s, a);
  AgreeOnUnit(begin_s, end_s, b);
}

void WritePoseFile(const std::filesystem::path& file, const Trajectory& trajectory, PoseFileFormat format,
                   const std::vector<std::int64_t>& stamps_ns) {
  if (format != PoseFileFormat::kG2o) {
    WriteTrajectory(file, trajectory, CoreFormat(format), stamps_ns);
    return;
  }
  if (!HasRotations(trajectory))
    throw InputError(file.string() +
                     ": can't be written: the poses are positions alone, and vertices of g2o need rotations; "
                     "write tum or euroc");
  PoseGraph graph(GraphKind::kSE3);
  for (std::size_t k = 0; k < trajectory.size(); ++k) {
    const int id = static_cast<int>(k);
    graph.AddNode(id, trajectory[k].pose);
    if (k == 0) continue;
    const Pose relative = trajectory[k - 1].pose.Inverse() * trajectory[k].pose;
    graph.AddOdometry(id - 1, id, Similarity(relative), Matrix7d::Identity());
  }
  WriteG2o(file, graph);
}

void WriteTimes(const std::filesystem::path& file, const Trajectory& trajectory,
                const std::vector<std::int64_t>& stamps_ns) {
  std::string text;
  for (std::size_t k = 0; k < trajectory.size(); ++k)
    text +=
        (stamps_ns.empty() ? internal::StampText(trajectory[k].stamp_s) : internal::StampText(stamps_ns[k])) +
        '\n';
  internal::WriteFile(file, text);
}

}  // namespace tutti
