// The files that a run leaves behind, and the table on the terminal.
#pragma once

#include <filesystem>
#include <string>

#include "apps/run/run_result.h"

namespace tutti {

/// Makes the folder, proves that it can be written to and has room, and removes a former run's files of the
/// same names. Throws InputError that says what to do.
void PrepareOutputFolder(const std::filesystem::path& out);

/// trajectory.txt, trajectory_odometry.txt, keyframes.txt (TUM), graph.g2o, loops.csv, summary.json,
/// trajectory.svg and trajectory.png; appearance only: loops.csv and summary.json. Throws InputError if one
/// can't be written in full.
void WriteOutputs(const std::filesystem::path& out, const RunResult& result);

/// summary.json and loops.csv as texts.
std::string SummaryJson(const RunResult& result);
std::string LoopsCsv(const RunResult& result);

/// The comparison with and without the ensemble, for the terminal.
std::string ResultTable(const RunResult& result);

}  // namespace tutti
