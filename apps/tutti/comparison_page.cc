#include "apps/tutti/comparison_page.h"

#include <string>
#include <utility>
#include <vector>

#include "apps/report/page.h"
#include "core/terminal.h"
#include "tutti/core/error.h"

namespace tutti::cli {

void WriteComparisonReport(const std::filesystem::path& file, const std::string& title,
                           const Comparison& comparison) {
  std::vector<ReportTable> tables;
  for (const ComparisonTable& table : ComparisonTables(comparison))
    tables.push_back({table.dataset, table.table.header, table.table.rows, table.notes, table.stages.header,
                      table.stages.rows});
  std::vector<nlohmann::ordered_json> runs;
  std::vector<std::string> failures;
  for (const RunFigures& run : comparison.runs) {
    if (!run.failure.empty())
      failures.push_back(run.variant + ", " + Describe(run.sample) + ": " + run.failure);
    try {
      auto report = ReadRunReport(run.folder);
      if (!report) continue;
      (*report)["variant"] = run.variant;
      runs.push_back(std::move(*report));
    } catch (const InputError& error) {
      failures.push_back(run.variant + ", " + Describe(run.sample) + ": no charts: " + error.what());
      internal::Say("warning: no charts of a run: %s", error.what());
    }
  }
  WriteReportPage(file, ComparisonPage(title, tables, std::move(runs), failures));
}

}  // namespace tutti::cli
