// Output folder, trajectories, graph and plots.
#include <algorithm>
#include <iterator>
#include <system_error>

#include "apps/plot/plot.h"
#include "apps/run/live_files.h"
#include "apps/run/outputs.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "tutti/backend/g2o_io.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

template <class Key>
std::optional<Eigen::Vector3d> Find(const std::map<Key, Eigen::Vector3d>& places, Key key) {
  const auto found = places.find(key);
  if (found == places.end()) return std::nullopt;
  return found->second;
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
  for (const Loop& loop : result.loops) {
    const auto a = places.AtEnd(loop.candidate, loop.candidate_stamp_s),
               b = places.AtEnd(loop.query, loop.query_stamp_s);
    if (loop.accepted() && a && b) plot.edges.emplace_back(*a, *b);
  }
  plot.edges_name = "accepted loops (" + std::to_string(result.LoopsAccepted()) + ")";
  for (const FoundFrame& frame : result.found) {
    if (const auto place = places.At(frame.stamp_s)) plot.marks.push_back(*place);
  }
  plot.marks_name = "found in the map (" + std::to_string(plot.marks.size()) + ")";
  return plot;
}

void WriteTum(const fs::path& file, const Trajectory& poses) {
  WriteTrajectory(file, poses, TrajectoryFormat::kTum);
}

/// A file that a run may leave.
struct RunFile {
  const char* name;
  bool needs_poses;
  void (*write)(const RunResult& result, const fs::path& file);  // null: WriteOutputs or somebody else does
};

// In the order in which they are written: what is worth most comes first.
const RunFile kFiles[] = {
    {"trajectory.txt", true, [](const RunResult& r, const fs::path& file) { WriteTum(file, r.trajectory); }},
    {"trajectory_online.txt", true,
     [](const RunResult& r, const fs::path& file) { WriteTum(file, r.trajectory_online); }},
    {"trajectory_odometry.txt", true,
     [](const RunResult& r, const fs::path& file) { WriteTum(file, r.trajectory_odometry); }},
    {"keyframes.txt", true,
     [](const RunResult& r, const fs::path& file) { WriteTum(file, r.keyframe_trajectory); }},
    {"summary.json", false,
     [](const RunResult& r, const fs::path& file) { internal::WriteFile(file, SummaryJson(r)); }},
    {"loops.csv", false,
     [](const RunResult& r, const fs::path& file) { internal::WriteFile(file, LoopsCsv(r)); }},
    {"graph.g2o", true, [](const RunResult& r, const fs::path& file) { WriteG2o(file, r.graph); }},
    {"trajectory.svg", true, [](const RunResult& r, const fs::path& file) { WriteSvg(file, MakePlot(r)); }},
    {"trajectory.png", true, [](const RunResult& r, const fs::path& file) { WritePng(file, MakePlot(r)); }},
    {kMap, false, nullptr},
    {kMesh, false, nullptr},
    {"report.html", false, nullptr},
    {"report.json", false, nullptr}};
constexpr const char* kPiece = "trajectory_piece_";  // and a number: other pieces of the map

bool IsResult(const fs::path& entry) {
  std::error_code ignored;
  const std::string name = entry.filename();
  const auto same = [&](const RunFile& file) { return name == file.name; };
  return !fs::is_directory(entry, ignored) &&
         (std::any_of(std::begin(kFiles), std::end(kFiles), same) || name.rfind(kPiece, 0) == 0);
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

void WriteOutputs(OutputFolder& folder, const RunRequest& request, RunResult& result,
                  const std::function<void(const fs::path&)>& map,
                  const std::function<std::string()>& trace) {
  for (const RunFile& file : kFiles) {
    if (file.write == nullptr || (file.needs_poses && result.appearance_only)) continue;
    folder.Write({file.name, [&](const fs::path& at) { file.write(result, at); }});
    for (std::size_t i = 0; &file == kFiles && i < result.other_pieces.size(); ++i)
      folder.Write({kPiece + std::to_string(i + 1) + ".txt",
                    [&](const fs::path& at) { WriteTum(at, result.other_pieces[i]); }});
  }
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
  const auto elsewhere = [&](const std::function<void()>& write) {
    Attempts writing;
    writing.Try(write);
    if (writing.Failed()) failures.push_back(writing.Failure());
  };
  if (trace) elsewhere([&] { internal::WriteFile(*request.trace, trace()); });
  if (map && request.save_map && !into_folder) elsewhere([&] { map(*request.save_map); });
  if (!result.failure.empty())
    internal::Say("the run broke off; what there was by then is in %s", result.folder.c_str());
  ThrowFailures(failures, result.folder);
}

}  // namespace tutti
