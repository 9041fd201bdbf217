// report.html: one file that needs no network, of one run or of several.
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tutti {

/// Version of report.json; a reader refuses others.
constexpr int kReportFormat = 2;

/// False if tutti was built without the chart library (no Node, or no network then): there are no pages.
bool ReportsAvailable();
/// What a build without it says, one line without a newline.
std::string ReportsMissing();

/// The page for this data: {"kind", "title", "runs", ...} (report.js). Texts may hold anything; they are
/// shown, never run. Empty if !ReportsAvailable().
std::string ReportPage(const nlohmann::ordered_json& data);

/// Writes file if ReportsAvailable(), else removes an older one of that name. Throws InputError if it can't
/// be written in full.
void WriteReportPage(const std::filesystem::path& file, const nlohmann::ordered_json& data);

/// Why this tutti was built without the chart library, and how to get it; empty if it has it.
std::string ChartLibraryMissing();

/// What the program was built with: name of each part -> its version.
nlohmann::ordered_json BuildInfo();

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

/// Bytes as text (RFC 4648), for pictures within a page.
std::string Base64(const void* bytes, std::size_t size);

}  // namespace tutti
