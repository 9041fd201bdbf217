// What a run measures of an RGB-D camera's clocks, and how it begins anew with that.
#pragma once

#include <optional>

#include "apps/run/runner.h"

namespace tutti {

/// Of what the images told so far (OdometryReport::clocks) the fields that are sure and far enough from what
/// the run was told for it to begin anew, 0 for the others; none if no field is.
std::optional<ClocksFound> SureClocks(const ClocksFound& found, const RunResult& result);

/// Of a run that stopped since it knows its clocks: `result` becomes `blank`, the result before its first
/// frame, with these clocks in its configuration and with the time that all beginnings took. Returns the data
/// set as it is read then. Throws InputError if it can't be opened any more.
std::unique_ptr<Dataset> BeginAnew(const RunRequest& request, const ClocksFound& clocks,
                                   const RunResult& blank, RunResult& result);

}  // namespace tutti
