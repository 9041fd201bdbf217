// report.html: one file that needs no network.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

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

}  // namespace tutti
