// Tables, JSON and CSV of `tutti evaluate`, and published figures beside one's own (--against).
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/tutti/evaluation_input.h"
#include "apps/tutti/published.h"
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

/// The rows of a benchmark, as papers print them: a table for each sensor and alignment, and the sources.
std::string DescribePublished(const std::string& benchmark, TableFormat format);

/// What is compared with what.
struct Against {
  std::string benchmark;
  std::string sequence;  ///< empty: it is looked for in the names of the files
  std::string sensor;    ///< mono, stereo, rgbd, stereo-inertial
};

/// Rows of one sequence, measured as the estimates were. Throws InputError that says what to pass if there
/// are none: another sensor, alignment or way of evaluation, or a sequence that is not known.
class PublishedComparison {
 public:
  PublishedComparison(const Against& against, const EvaluationInput& input);

  /// The estimates among the published rows, the smallest error first.
  std::string Describe(const std::vector<EvaluatedEstimate>& estimates, TableFormat format) const;
  nlohmann::ordered_json ToJson() const;

 private:
  std::string benchmark_, sequence_, sensor_, alignment_;
  std::vector<const PublishedRow*> rows_;  // of the sequence
};

}  // namespace tutti::cli
