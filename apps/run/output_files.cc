// Output folder, trajectories, graph and plots.
#include <array>
#include <cstdint>
#include <fstream>
#include <system_error>

#include "apps/plot/plot.h"
#include "apps/run/outputs.h"
#include "apps/run/text_file.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 10> kFiles = {
    "trajectory.txt", "trajectory_odometry.txt", "keyframes.txt",  "graph.g2o",   "loops.csv",
    "summary.json",   "trajectory.svg",          "trajectory.png", "report.html", "report.json"};
constexpr std::uintmax_t kRoomBytes = 32u << 20;  // a long run writes a few MB

// Of the i-th of the pieces that are not joined to the trajectory, from 1.
std::string PieceFile(int i) { return "trajectory_piece_" + std::to_string(i) + ".txt"; }

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
  std::map<double, Eigen::Vector3d> at;
  for (const StampedPose& pose : result.trajectory) at[pose.stamp_s] = align_slam * pose.pose.translation;
  for (const LoopRecord& loop : result.loops) {
    const auto a = at.find(loop.candidate_stamp_s), b = at.find(loop.query_stamp_s);
    if (loop.accepted && a != at.end() && b != at.end()) plot.edges.emplace_back(a->second, b->second);
  }
  plot.edges_name = "accepted loops (" + std::to_string(result.LoopsAccepted()) + ")";
  return plot;
}

}  // namespace

void WriteTextFile(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  if (!out)
    throw InputError(file.string() + ": can't be written; check that the folder exists and is writable");
  out << text;
  out.flush();
  if (!out) throw InputError(file.string() + ": could not be written in full; is the disk full?");
}

std::size_t RunResult::LoopsAccepted() const {
  std::size_t count = 0;
  for (const LoopRecord& loop : loops) count += loop.accepted ? 1 : 0;
  return count;
}

void PrepareOutputFolder(const fs::path& out) {
  std::error_code error;
  if (fs::exists(out, error) && !fs::is_directory(out, error)) {
    throw InputError(out.string() + ": is a file; --out needs a folder");
  }
  fs::create_directories(out, error);
  if (error) {
    throw InputError(out.string() + ": the folder can't be made (" + error.message() +
                     "); choose another --out");
  }
  const fs::path probe = out / ".tutti-write-test";
  {
    std::ofstream file(probe, std::ios::binary);
    if (!file) throw InputError(out.string() + ": no permission to write there; choose another --out");
    file << std::string(1 << 16, 'x');
    file.flush();
    if (!file) {
      fs::remove(probe, error);
      throw InputError(out.string() + ": the disk is full; free some space or choose another --out");
    }
  }
  fs::remove(probe, error);
  const fs::space_info space = fs::space(out, error);
  if (!error && space.available < kRoomBytes) {
    throw InputError(out.string() +
                     ": less than 32 MB are free there; free some space or choose another --out");
  }
  for (const char* name : kFiles) fs::remove(out / name, error);
  for (int i = 1; fs::remove(out / PieceFile(i), error); ++i) {
  }
}

void WriteOutputs(const fs::path& out, const RunResult& result) {
  WriteTextFile(out / "loops.csv", LoopsCsv(result));
  if (!result.appearance_only) {
    WriteTrajectory(out / "trajectory.txt", result.trajectory, TrajectoryFormat::kTum);
    for (std::size_t i = 0; i < result.other_pieces.size(); ++i) {
      WriteTrajectory(out / PieceFile(static_cast<int>(i) + 1), result.other_pieces[i],
                      TrajectoryFormat::kTum);
    }
    WriteTrajectory(out / "trajectory_odometry.txt", result.trajectory_odometry, TrajectoryFormat::kTum);
    WriteTrajectory(out / "keyframes.txt", result.keyframe_trajectory, TrajectoryFormat::kTum);
    WriteG2o(out / "graph.g2o", result.graph);
    const TrajectoryPlot plot = MakePlot(result);
    WriteSvg(out / "trajectory.svg", plot);
    WritePng(out / "trajectory.png", plot);
  }
  WriteTextFile(out / "summary.json", SummaryJson(result));
}

}  // namespace tutti
