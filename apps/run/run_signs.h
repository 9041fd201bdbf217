// Whether the result of a run can be believed: what the run shows of itself, and what a ground truth says
// where there is one, each sign once with its limits; and what they come to, in a word and with reasons.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "apps/run/run_result.h"

namespace tutti {

/// One kind of sign. summary.json, RunHealth, the report and `./dev bench health` use
/// this list alone.
struct SignKind {
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  const char* name;     ///< in summary.json
  const char* unit;     ///< "share": 0..1, shown in percent; "1": a number; "px", "factor"
  const char* meaning;  ///< what is measured
  bool above;           ///< bad above its limits; false: below
  double doubtful;      ///< limit from which on the result is in doubt; kNever: none
  double failed;        ///< limit from which on it is worth nothing
  const char* says;     ///< what is wrong, in a sentence whose %s is the value
  const char* advice;   ///< what to do
  std::optional<double> (*measure)(const RunResult&);  ///< none: this run has no such sign

  bool IsDoubtful(double value) const { return Beyond(value, doubtful); }
  bool IsFailed(double value) const { return Beyond(value, failed); }

 private:
  bool Beyond(double value, double limit) const {
    return limit != kNever && (above ? value > limit : value < limit);
  }
};

/// All that there are.
const std::vector<SignKind>& SignKinds();

/// One of them, of one run.
struct RunSign {
  const SignKind* kind = nullptr;  ///< never null
  double value = 0;
};

/// Those that this run has, in the order of SignKinds. None for an image sequence without poses.
std::vector<RunSign> SignsOf(const RunResult& result);

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
