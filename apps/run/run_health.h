// Whether the result of a run can be believed, in a word and with reasons.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/run/run_signs.h"

namespace tutti {

enum class HealthWord { kGood, kDoubtful, kFailed };
const char* ToString(HealthWord word);  ///< "good", "doubtful", "failed"

/// What the run itself shows, and its ground truth if it has one.
struct RunHealth {
  HealthWord word = HealthWord::kGood;
  std::vector<std::string> reasons;  ///< sentences: what is wrong, and what to do; none if good
  std::vector<RunSign> signs;        ///< that it was judged by
};

/// Good: no sign is beyond its limit. Failed: one is beyond the outer limit, or no frame has a pose. None for
/// an image sequence without poses.
std::optional<RunHealth> HealthOf(const RunResult& result);

/// The last lines of `tutti run` and `tutti close`; empty without health.
std::string HealthText(const RunResult& result);

}  // namespace tutti
