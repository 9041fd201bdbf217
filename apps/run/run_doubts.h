// Why the result of a run may be wrong although the run went through.
#pragma once

#include <string>
#include <vector>

#include "apps/run/run_result.h"

namespace tutti {

/// What the run itself shows, without ground truth, as sentences for the user: that many frames have no pose,
/// or that the map contradicts most of the loops that were recognised. Empty for an image sequence without
/// poses, and for a run without one (RunResult::Void says that).
std::vector<std::string> DoubtsAbout(const RunResult& result);

}  // namespace tutti
