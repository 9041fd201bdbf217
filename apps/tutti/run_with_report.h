// A run and the report beside it.
#pragma once

#include <string>

#include "apps/run/runner.h"
#include "apps/run/shared_odometry.h"

namespace tutti::cli {

/// RunSlam, with report.json and report.html (the page, unless tutti was built without the chart library)
/// among its files. Throws what RunSlam does, and InputError if they can't be written.
RunResult RunWithReport(RunRequest request, const RunConfig& config);

/// The same for a sequence that is tracked without loops, and for loops that are closed on it.
TrackedSequence TrackWithReport(RunRequest request, const RunConfig& config);
RunResult CloseLoopsWithReport(const TrackedSequence& tracked, RunRequest request, const RunConfig& config);

}  // namespace tutti::cli
