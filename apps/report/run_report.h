// What a report says of one run, as JSON: the page draws it, and a comparison puts several of them together.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/report/detection_log.h"
#include "apps/run/run_result.h"

namespace tutti {

/// Everything that the page shows of a run. `variant`: "ensemble", "odometry", or the rule. Reads images of
/// the data set again for the gallery, unless each can be read only once. Lengths [m] (mono without a
/// reference: map units), times [s] or [ms] as the names say. Deterministic but for the timings.
nlohmann::ordered_json RunReport(const RunResult& result, const DetectionLog& log,
                                 const std::string& variant);

/// "odometry" without loops, "ensemble" for the rule joint, "seed" for standardised-mean, else the rule.
std::string VariantName(const RunConfig& config);

}  // namespace tutti
