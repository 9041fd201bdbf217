// Output folder, trajectories, graph and plots.
#include <algorithm>
#include <array>
#include <cstdio>
#include <system_error>

#include "apps/plot/plot.h"
#include "apps/run/live_files.h"
#include "apps/run/outputs.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

template <class Key>
std::optional<Eigen::Vector3d> Find(const std::map<Key, Eigen::Vector3d>& places, Key key) {
  const auto found = places.find(key);
  if (found == places.end()) return std::nullopt;
  return found->second;
}

// All that a run may leave, for RunFiles and IsResult to agree; pieces of the map have numbers.
constexpr std::array<const char*, 12> kFiles = {"trajectory.txt",
                                                "trajectory_odometry.txt",
                                                "trajectory_online.txt",
                                                "keyframes.txt",
                                                "graph.g2o",
                                                "loops.csv",
                                                "summary.json",
                                                "trajectory.svg",
                                                "trajectory.png",
                                                kMap,
                                                "report.html",
                                                "report.json"};
constexpr const char* kPiece = "trajectory_piece_";

bool IsResult(const fs::path& entry) {
  std::error_code ignored;
  const std::string name = entry.filename();
  return !fs::is_directory(entry, ignored) &&
         (std::count(kFiles.begin(), kFiles.end(), name) > 0 || name.rfind(kPiece, 0) == 0);
}

std::vector<Eigen::Vector3d> Positions(const Trajectory& trajectory, const Similarity& alignment) {
  std::vector<Eigen::Vector3d> points;
  points.reserve(trajectory.size());
  for (const StampedPose& pose : trajectory) points.push_back(alignment * pose.pose.translation);
  return points;
}

TrajectoryPlot MakePlot(const RunResult& result) {
  TrajectoryPlot plot;
  const bool mono = result.rig.sensor == Sensor::kMono;
  const bool reference = result.evaluation && result.evaluation->slam.valid;
  plot.title =
      "Trajectory, " + std::string(reference ? "aligned to the reference" : "in the first camera's frame");
  plot.unit = mono && !reference ? "initial scale" : "m";
  Similarity align_slam, align_odometry;
  if (reference) {
    plot.series.push_back({"reference", Positions(result.reference, {}), "#333333", 2.5, true});
    align_slam = result.evaluation->slam.alignment;
    if (result.evaluation->odometry.valid) align_odometry = result.evaluation->odometry.alignment;
  }
  plot.series.push_back(
      {"odometry alone", Positions(result.trajectory_odometry, align_odometry), "#d55e00", 1.5, false});
  if (result.corrections > 0) {
    plot.series.push_back(
        {"with loop closure", Positions(result.trajectory, align_slam), "#0072b2", 1.8, false});
  }
  for (std::size_t k = 0; result.map && k < result.map->earlier.size(); ++k) {
    plot.series.push_back({"session " + std::to_string(k + 1), Positions(result.map->earlier[k], align_slam),
                           SessionColor(k), 1.2, true});
  }
  const FramePlaces places(result, align_slam);
  for (const LoopRecord& loop : result.loops) {
    const auto a = places.AtEnd(loop.candidate, loop.candidate_stamp_s),
               b = places.AtEnd(loop.query, loop.query_stamp_s);
    if (loop.accepted && a && b) plot.edges.emplace_back(*a, *b);
  }
  plot.edges_name = "accepted loops (" + std::to_string(result.LoopsAccepted()) + ")";
  for (const FoundFrame& frame : result.found) {
    if (const auto place = places.At(frame.stamp_s)) plot.marks.push_back(*place);
  }
  plot.marks_name = "found in the map (" + std::to_string(plot.marks.size()) + ")";
  return plot;
}

}  // namespace

void Attempts::Try(const std::function<void()>& step) noexcept {
  try {
    step();
  } catch (...) {
    if (first_ == nullptr) first_ = std::current_exception();
  }
}

void Attempts::Rethrow() const {
  if (first_ != nullptr) std::rethrow_exception(first_);
}

std::string Attempts::Failure() const {
  try {
    Rethrow();
    return "";
  } catch (const std::exception& thrown) {
    return thrown.what();
  } catch (...) {
    return "unknown";
  }
}

FramePlaces::FramePlaces(const RunResult& result, const Similarity& alignment) {
  for (const StampedPose& pose : result.trajectory) own_[pose.stamp_s] = alignment * pose.pose.translation;
  if (!result.map) return;
  first_frame_ = result.map->sessions.back().frame_offset;
  for (const auto& [frame, pose] : result.map->keyframes) earlier_[frame] = alignment * pose.translation;
}

std::optional<Eigen::Vector3d> FramePlaces::At(double stamp_s) const { return Find(own_, stamp_s); }

std::optional<Eigen::Vector3d> FramePlaces::AtEnd(std::int64_t frame, double stamp_s) const {
  return frame < first_frame_ ? Find(earlier_, frame) : At(stamp_s);
}

OutputLayout RunLayout() {
  return {IsResult, "summary.json", "version", {kLiveTrajectory, kLiveLoops}, nullptr, {kCheckpoint}};
}

OutputFolder OpenOutputFolder(const RunRequest& request, const fs::path& reference) {
  if (!reference.empty()) RefuseToReplace(request.out, reference);
  OutputLayout layout = RunLayout();
  layout.known = request.resume.has_value();  // by its checkpoint, which was read
  return OutputFolder(request.out, layout, request.keep, request.trace);
}

namespace {

// In the order in which they are written: what is worth most comes first.
std::vector<OutputFile> RunFiles(const RunResult& result) {
  const auto trajectory = [](const Trajectory& poses) {
    return [&poses](const fs::path& file) { WriteTrajectory(file, poses, TrajectoryFormat::kTum); };
  };
  const auto text = [&result](std::string (*text_of)(const RunResult&)) {
    return [&result, text_of](const fs::path& file) { internal::WriteFile(file, text_of(result)); };
  };
  std::vector<OutputFile> files;
  const bool poses = !result.appearance_only;
  if (poses) {
    files.push_back({"trajectory.txt", trajectory(result.trajectory)});
    for (std::size_t i = 0; i < result.other_pieces.size(); ++i)
      files.push_back({kPiece + std::to_string(i + 1) + ".txt", trajectory(result.other_pieces[i])});
    files.push_back({"trajectory_online.txt", trajectory(result.trajectory_online)});
    files.push_back({"trajectory_odometry.txt", trajectory(result.trajectory_odometry)});
    files.push_back({"keyframes.txt", trajectory(result.keyframe_trajectory)});
  }
  files.push_back({"summary.json", text(SummaryJson)});
  files.push_back({"loops.csv", text(LoopsCsv)});
  if (poses) {
    files.push_back({"graph.g2o", [&result](const fs::path& file) { WriteG2o(file, result.graph); }});
    files.push_back(
        {"trajectory.svg", [&result](const fs::path& file) { WriteSvg(file, MakePlot(result)); }});
    files.push_back(
        {"trajectory.png", [&result](const fs::path& file) { WritePng(file, MakePlot(result)); }});
  }
  return files;
}

}  // namespace

void WriteOutputs(OutputFolder& folder, const RunRequest& request, RunResult& result,
                  const std::function<void(const fs::path&)>& map,
                  const std::function<std::string()>& trace) {
  for (const OutputFile& file : RunFiles(result)) folder.Write(file);
  Attempts more;
  more.Try([&] {
    if (!request.more_files) return;
    for (const OutputFile& file : request.more_files(result)) folder.Write(file);
  });
  const bool into_folder = request.save_map && *request.save_map == kMap;
  if (map && into_folder) folder.Write({kMap, map});
  result.folder = folder.Finish(result.Finished() && !more.Failed());
  std::vector<std::string> failures = folder.failures();
  if (more.Failed()) failures.push_back("the report: " + more.Failure());
  if (trace) {
    Attempts writing;
    writing.Try([&] { internal::WriteFile(*request.trace, trace()); });
    if (writing.Failed()) failures.push_back(writing.Failure());
  }
  if (map && request.save_map && !into_folder) {
    Attempts writing;
    writing.Try([&] { map(*request.save_map); });
    if (writing.Failed()) failures.push_back(writing.Failure());
  }
  if (!result.failure.empty())
    internal::Say("the run broke off; what there was by then is in %s", result.folder.c_str());
  ThrowFailures(failures, result.folder);
}

}  // namespace tutti
