#include "apps/tutti/run_with_report.h"

#include <memory>

#include "apps/report/comparison_report.h"
#include "apps/report/page.h"
#include "apps/report/run_report.h"
#include "apps/tutti/files.h"

namespace tutti::cli {

namespace {

void WriteReport(const std::filesystem::path& out, const RunResult& result, const DetectionLog& log) {
  nlohmann::ordered_json report = RunReport(result, log, VariantName(result.config));
  WriteText(out / "report.json",
            report.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
  WriteReportPage(out / "report.html", SingleRunPage(std::move(report)));
}

}  // namespace

RunResult RunWithReport(RunRequest request, const RunConfig& config) {
  const auto log = std::make_shared<DetectionLog>();
  request.observers.push_back(log);
  RunResult result = RunSlam(request, config);
  WriteReport(request.out, result, *log);
  return result;
}

TrackedSequence TrackWithReport(const RunRequest& request, const RunConfig& config) {
  TrackedSequence sequence = TrackSequence(request, config);
  WriteReport(request.out, sequence.result, DetectionLog());
  return sequence;
}

RunResult CloseLoopsWithReport(const TrackedSequence& tracked, RunRequest request, const RunConfig& config) {
  const auto log = std::make_shared<DetectionLog>();
  request.observers.push_back(log);
  RunResult result = CloseLoops(tracked, request, config);
  WriteReport(request.out, result, *log);
  return result;
}

}  // namespace tutti::cli
