// The files that a run leaves behind, and the table on the terminal.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/run/output_folder.h"
#include "apps/run/run_result.h"
#include "apps/run/runner.h"

namespace tutti {

/// RunRequest::save_map of a map that lies beside the other results.
constexpr const char* kMap = "map.tutti";

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
