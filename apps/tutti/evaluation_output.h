// Tables, JSON and CSV of `tutti evaluate`.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/tutti/evaluation_input.h"
#include "apps/tutti/text_table.h"

namespace tutti::cli {

/// All statistics of one estimate.
std::string DescribeEvaluation(const EvaluatedEstimate& estimate, TableFormat format);
/// One line per estimate.
std::string CompareEvaluations(const std::vector<EvaluatedEstimate>& estimates, TableFormat format);

/// Everything; for one estimate its figures, for several a list `estimates`.
nlohmann::ordered_json EvaluationJson(const std::string& reference,
                                      const std::vector<EvaluatedEstimate>& estimates);
/// Errors pose by pose.
std::string ErrorsCsv(const std::vector<EvaluatedEstimate>& estimates);

}  // namespace tutti::cli
