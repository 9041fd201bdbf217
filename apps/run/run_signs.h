// What a run shows of itself, and what a ground truth says where there is one: each sign once, with its
// limits.
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "apps/run/run_result.h"

namespace tutti {

/// One kind of sign. summary.json, the words of a run (RunHealth), the report and `./dev bench health` use
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

}  // namespace tutti
