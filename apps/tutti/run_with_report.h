// A run with its report, and how it ends: what is printed of it, and the exit status.
#pragma once

#include "apps/run/run_signs.h"
#include "apps/run/runner.h"
#include "apps/run/shared_odometry.h"

namespace CLI {
class App;
}

namespace tutti::cli {

/// The request of a run with report.json and report.html (the page, unless tutti was built without the chart
/// library) among its files. `loops`: false for a sequence that is tracked without (TrackSequence).
RunRequest WithReport(RunRequest request, bool loops = true);

/// --require, --no-report and --quiet.
struct OutcomeOptions {
  HealthWord require = HealthWord::kDoubtful;  ///< what the run's health must be at least
  bool no_report = false, quiet = false;
};
void AddOutcomeOptions(CLI::App& command, OutcomeOptions& options);

/// The run, with its report if that is wanted, and its table on the terminal.
RunResult RunAndPrint(const RunRequest& request, const RunConfig& config, const OutcomeOptions& options = {});

/// Exit status of a run: 0, 1 if it is void, 130 if it was interrupted, as shells say it.
int StatusOf(const RunResult& result);

/// The same, after the health of the run was printed, and the reason on standard error; 1 also where the
/// health is below what is required.
int Conclude(const RunResult& result, const OutcomeOptions& options);

}  // namespace tutti::cli
