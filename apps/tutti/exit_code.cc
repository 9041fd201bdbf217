#include "apps/tutti/exit_code.h"

#include <cstdio>
#include <optional>
#include <string>

#include "apps/run/run_signs.h"
#include "apps/run/run_parts.h"
#include "apps/tutti/checks.h"
#include "core/terminal.h"

namespace tutti::cli {

void AddRequireOption(CLI::App& command, std::string& word) {
  command
      .add_option("--require", word,
                  "exit status 1 if the health of the result, the last thing that is printed, is below this "
                  "word; failed: only if there is no pose")
      ->check(OneOf(
          {ToString(HealthWord::kGood), ToString(HealthWord::kDoubtful), ToString(HealthWord::kFailed)}))
      ->capture_default_str();
}

int ExitCode(const RunResult& result, const std::string& required) {
  const std::optional<RunHealth> health = HealthOf(result);
  if (health)
    std::fputs(internal::Message(HealthText(result), stdout, internal::Breaks::kAll).c_str(), stdout);
  std::fflush(stdout);  // before what follows on the other stream
  if (result.interrupted) {
    internal::Say("interrupted; what there was by then is in %s", result.folder.c_str());
    return 130;
  }
  if (result.frames_total > 0 && result.bad.size() == result.frames_total) {
    internal::Say("the run is void: not one frame could be read; the first: %s",
                  result.bad.front().error.c_str());
    return 1;
  }
  if (result.Void() && result.frames_without_depth > 0 &&
      result.frames_without_depth == result.frame_ms.size()) {
    const char* const which = DepthSource(result.rig.sensor);
    internal::Say("the run is void: not one frame has a %s image to start a map from%s%s", which,
                  result.bad_depth.empty() ? "" : "; the first: ",
                  result.bad_depth.empty() ? "" : result.bad_depth.front().error.c_str());
    return 1;
  }
  if (result.Void()) {
    const std::string reason = result.lost.empty() ? std::string("no frames") : result.lost.back().reason;
    internal::Say(
        "the run is void: no frame has a pose (%s); check the calibration and that the camera moves",
        reason.c_str());
    return 1;
  }
  const HealthWord bar = required == ToString(HealthWord::kGood)       ? HealthWord::kGood
                         : required == ToString(HealthWord::kDoubtful) ? HealthWord::kDoubtful
                                                                       : HealthWord::kFailed;
  if (health && health->word > bar) {
    internal::Say("the result is %s, and --require %s asks for more: exit status 1", ToString(health->word),
                  required.c_str());
    return 1;
  }
  return 0;
}

}  // namespace tutti::cli
