#include "apps/tutti/exit_code.h"

#include <cstdio>
#include <string>

#include "apps/run/run_parts.h"
#include "core/terminal.h"

namespace tutti::cli {

int ExitCode(const RunResult& result) {
  if (result.interrupted) {
    std::fprintf(stderr, "tutti: interrupted; what there was by then is in %s\n",
                 internal::Printable(result.folder.string()).c_str());
    return 130;
  }
  if (result.frames_total > 0 && result.bad.size() == result.frames_total) {
    std::fprintf(stderr, "tutti: the run is void: not one frame could be read; the first: %s\n",
                 internal::Printable(result.bad.front().error).c_str());
    return 1;
  }
  if (result.Void() && result.frames_without_depth > 0 &&
      result.frames_without_depth == result.frame_ms.size()) {
    const char* const which = DepthSource(result.rig.sensor);
    std::fprintf(stderr, "tutti: the run is void: not one frame has a %s image to start a map from%s%s\n",
                 which, result.bad_depth.empty() ? "" : "; the first: ",
                 result.bad_depth.empty() ? "" : internal::Printable(result.bad_depth.front().error).c_str());
    return 1;
  }
  if (result.Void()) {
    const std::string reason = result.lost.empty() ? std::string("no frames") : result.lost.back().reason;
    std::fprintf(
        stderr,
        "tutti: the run is void: no frame has a pose (%s); check the calibration and that the camera moves\n",
        reason.c_str());
    return 1;
  }
  return 0;
}

}  // namespace tutti::cli
