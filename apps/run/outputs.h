// The files that a run leaves behind, and the table on the terminal.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/run/output_folder.h"
#include "apps/run/run_result.h"
#include "apps/run/runner.h"

namespace tutti {

/// Steps of a run that go on after one has failed, so that what there is gets written.
class Attempts {
 public:
  void Try(const std::function<void()>& step) noexcept;
  bool Failed() const { return first_ != nullptr; }
  /// What the first failure was; empty for none.
  std::string Failure() const;
  /// Throws it on, if there is one.
  void Rethrow() const;

 private:
  std::exception_ptr first_;
};

/// RunRequest::save_map of a map that lies beside the other results.
constexpr const char* kMap = "map.tutti";
constexpr const char* kMesh = "mesh.ply";  // of run --dense

/// Where the frames of a run are in its map, for what draws them: positions of trajectory.txt, and of the
/// keyframes that the map had before [m; one camera without a reference: in units of the first scale], after
/// `alignment`.
class FramePlaces {
 public:
  FramePlaces(const RunResult& result, const Similarity& alignment);

  /// Where the run's own frame with this stamp [s] is; nothing if trajectory.txt has no pose for it.
  std::optional<Eigen::Vector3d> At(double stamp_s) const;
  /// Where an end of a loop is: the frame has its number in the map (Loop), and a stamp of its
  /// recording.
  std::optional<Eigen::Vector3d> AtEnd(std::int64_t frame, double stamp_s) const;

 private:
  std::int64_t first_frame_ = 0;
  std::map<double, Eigen::Vector3d> own_;            // by stamp
  std::map<std::int64_t, Eigen::Vector3d> earlier_;  // by number
};

/// What a run leaves in its folder.
OutputLayout RunLayout();

/// Opens the folder of a run. Throws InputError that says what to do; also if `reference` (a file; empty for
/// none) lies inside.
OutputFolder OpenOutputFolder(const RunRequest& request, const std::filesystem::path& reference);

/// Writes all files and puts them into place: trajectory.txt first, then trajectory_online.txt,
/// trajectory_odometry.txt, keyframes.txt (TUM), summary.json, loops.csv, graph.g2o, trajectory.svg and .png;
/// appearance only: loops.csv and summary.json; then RunRequest::more_files, and the trace into the file that
/// it is for, and the map (RunRequest::save_map). What can't be written does not stop the rest. Sets
/// RunResult::folder. Throws InputError that names what is missing.
void WriteOutputs(OutputFolder& folder, const RunRequest& request, RunResult& result,
                  const std::function<void(const std::filesystem::path&)>& map = {},
                  const std::function<std::string()>& trace = {});

/// HealthOf as in summary.json and report.json: word, reasons, signs; null without poses.
nlohmann::ordered_json HealthJson(const RunResult& result);

/// summary.json and loops.csv as texts.
std::string SummaryJson(const RunResult& result);
std::string LoopsCsv(const RunResult& result);
/// loops.csv in parts. `members` have columns beside SURF, SIFT and ORB: those that OtherMembers returns.
std::vector<std::string> OtherMembers(const std::vector<std::string>& members);
std::string LoopsCsvHeader(const std::vector<std::string>& members);
std::string LoopsCsvLine(const Loop& loop, const std::vector<std::string>& members,
                         const LoopError& error = {});

/// The comparison with and without the ensemble, for the terminal.
std::string ResultTable(const RunResult& result);

}  // namespace tutti
