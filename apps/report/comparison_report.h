// One page over several runs.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tutti {

/// A table over the runs of one data set.
struct ReportTable {
  std::string dataset;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
  std::vector<std::string> notes;                    ///< lines below it
  std::vector<std::string> stage_header;             ///< time per stage, for the tab Timing; may be empty
  std::vector<std::vector<std::string>> stage_rows;  ///< one for each stage
};

/// The report.json of a run's folder; nothing if there is none, or it is of another version of the format.
/// Throws InputError that names the file if it is damaged.
std::optional<nlohmann::ordered_json> ReadRunReport(const std::filesystem::path& folder);

/// The page's data for one run.
nlohmann::ordered_json SingleRunPage(nlohmann::ordered_json run);

/// The page's data for many. Each data set and variant is shown by its first run in the list; the tables are
/// of all. Galleries are cut to a few pictures of each outcome, so that the page stays small. `failures`:
/// runs that left nothing.
nlohmann::ordered_json ComparisonPage(const std::string& title, const std::vector<ReportTable>& tables,
                                      std::vector<nlohmann::ordered_json> runs,
                                      const std::vector<std::string>& failures);

}  // namespace tutti
