// What `tutti evaluate` and `tutti plot` have in common: a reference, estimates, and how they are compared.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "tutti/backend/evaluation.h"

namespace tutti::cli {

/// The command line's words.
struct EvaluationInput {
  std::string reference;
  std::vector<std::string> estimates, names;  ///< names: of the estimates, for tables; empty: their files
  std::string format = "auto", reference_format, times;  ///< reference_format: empty for that of `format`
  std::string align = "se3", vertical = "z", rpe_unit = "frames";
  EvaluationOptions options;  ///< without what the words above say
};

/// Adds --reference, --estimate and everything about formats, association, alignment and relative errors.
void AddEvaluationOptions(CLI::App& command, EvaluationInput& input);

/// One estimate, measured.
struct EvaluatedEstimate {
  std::string name, file;
  EvaluationOptions options;  ///< that were used
  EvaluationReport report;
};

/// Reads all files (warnings go to stderr) and measures each estimate. KITTI against KITTI without times is
/// paired line by line. Throws InputError that names the files.
std::vector<EvaluatedEstimate> EvaluateInput(const EvaluationInput& input);

}  // namespace tutti::cli
