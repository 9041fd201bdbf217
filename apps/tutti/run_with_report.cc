#include "apps/tutti/run_with_report.h"

#include <memory>
#include <utility>
#include <vector>

#include "apps/report/page.h"
#include "apps/report/run_report.h"
#include "apps/tutti/files.h"
#include "core/replaced_file.h"

namespace tutti::cli {

namespace {

// The report's files, as RunRequest::more_files.
std::function<std::vector<OutputFile>(const RunResult&)> ReportOf(
    const std::shared_ptr<const DetectionLog>& log) {
  return [log](const RunResult& result) {
    const auto report =
        std::make_shared<nlohmann::ordered_json>(RunReport(result, *log, VariantName(result.config)));
    std::vector<OutputFile> files;
    files.push_back({"report.json", [report](const std::filesystem::path& file) {
                       const auto replace = nlohmann::ordered_json::error_handler_t::replace;
                       internal::WriteFile(file, report->dump(-1, ' ', false, replace) + "\n");
                     }});
    if (!ReportsAvailable()) return files;
    files.push_back({"report.html", [report](const std::filesystem::path& file) {
                       WriteReportPage(file, SingleRunPage(std::move(*report)));
                     }});
    return files;
  };
}

}  // namespace

RunResult RunWithReport(RunRequest request, const RunConfig& config) {
  const auto log = std::make_shared<DetectionLog>();
  request.observers.push_back(log);
  request.more_files = ReportOf(log);
  return RunSlam(request, config);
}

TrackedSequence TrackWithReport(RunRequest request, const RunConfig& config) {
  request.more_files = ReportOf(std::make_shared<DetectionLog>());
  return TrackSequence(request, config);
}

RunResult CloseLoopsWithReport(const TrackedSequence& tracked, RunRequest request, const RunConfig& config) {
  const auto log = std::make_shared<DetectionLog>();
  request.observers.push_back(log);
  request.more_files = ReportOf(log);
  return CloseLoops(tracked, request, config);
}

}  // namespace tutti::cli
