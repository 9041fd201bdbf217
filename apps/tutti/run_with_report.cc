#include "apps/tutti/run_with_report.h"

#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/report/page.h"
#include "apps/report/run_report.h"
#include "apps/run/outputs.h"
#include "apps/run/run_parts.h"
#include "apps/tutti/options.h"
#include "core/replaced_file.h"
#include "core/terminal.h"

namespace tutti::cli {
namespace {

const EnumWords<HealthWord>& HealthWords() {
  static const EnumWords<HealthWord> words = {{ToString(HealthWord::kGood), HealthWord::kGood},
                                              {ToString(HealthWord::kDoubtful), HealthWord::kDoubtful},
                                              {ToString(HealthWord::kFailed), HealthWord::kFailed}};
  return words;
}

}  // namespace

RunRequest WithReport(RunRequest request, bool loops) {
  const auto log = std::make_shared<DetectionLog>();
  if (loops) request.observers.push_back(log);
  request.more_files = [log](const RunResult& result) {
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
  return request;
}

void AddOutcomeOptions(CLI::App& command, OutcomeOptions& options) {
  AddWord(command, "--require", options.require,
          "exit status 1 if the health of the result, the last thing that is printed, is below this word; "
          "failed: only if there is no pose",
          HealthWords())
      ->default_str(ToString(options.require));
  command.add_flag("--no-report", options.no_report, "no report.html and report.json");
  command.add_flag("--quiet", options.quiet, "no progress and no notes");
}

RunResult RunAndPrint(const RunRequest& request, const RunConfig& config, const OutcomeOptions& options) {
  RunResult result = RunSlam(options.no_report ? request : WithReport(request), config);
  std::fputs(internal::Message(ResultTable(result), stdout, internal::Breaks::kAll).c_str(), stdout);
  return result;
}

int StatusOf(const RunResult& result) { return result.interrupted ? 130 : result.Void() ? 1 : 0; }

int Conclude(const RunResult& result, const OutcomeOptions& options) {
  if (!options.no_report && !options.quiet && !ReportsAvailable())
    internal::Say("%s", ReportsMissing().c_str());
  const std::optional<RunHealth> health = HealthOf(result);
  if (health)
    std::fputs(internal::Message(HealthText(result), stdout, internal::Breaks::kAll).c_str(), stdout);
  std::fflush(stdout);  // before what follows on the other stream
  const int status = StatusOf(result);
  if (result.interrupted) {
    internal::Say("interrupted; what there was by then is in %s", result.folder.c_str());
  } else if (result.frames_total > 0 && result.bad.size() == result.frames_total) {
    internal::Say("the run is void: not one frame could be read; the first: %s",
                  result.bad.front().error.c_str());
    return 1;
  } else if (status != 0 && result.frames_without_depth > 0 &&
             result.frames_without_depth == result.frame_ms.size()) {
    const std::vector<BadFrame>& bad = result.bad_depth;
    internal::Say("the run is void: not one frame has a %s image to start a map from%s%s",
                  DepthSource(result.rig.sensor),
                  bad.empty() ? "" : "; the first: ", bad.empty() ? "" : bad.front().error.c_str());
  } else if (status != 0) {
    const std::string reason = result.lost.empty() ? std::string("no frames") : result.lost.back().reason;
    internal::Say(
        "the run is void: no frame has a pose (%s); check the calibration and that the camera moves",
        reason.c_str());
  } else if (health && health->word > options.require) {
    internal::Say("the result is %s, and --require %s asks for more: exit status 1", ToString(health->word),
                  ToString(options.require));
    return 1;
  }
  return status;
}

}  // namespace tutti::cli
