// What `tutti evaluate` and the Python module have in common: two files compared, and all figures of it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tutti/backend/evaluation.h"
#include "tutti/backend/trajectory_file.h"

namespace tutti::cli {

/// A trajectory, and what it is called.
struct NamedPoses {
  std::string name;
  PoseFile poses;
};

/// Measures the estimate. Of files without time stamps the lines are paired (KITTI) or the ids (g2o): sets
/// options.by_index. `remedy`: what gives time stamps to the one that has none. Throws InputError that names
/// both.
EvaluationReport EvaluateFiles(const NamedPoses& reference, const NamedPoses& estimate,
                               const std::string& remedy, EvaluationOptions& options);

/// All figures.
nlohmann::ordered_json ReportJson(const EvaluationReport& report, const EvaluationOptions& options);

}  // namespace tutti::cli
