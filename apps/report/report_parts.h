// The parts of a run's report.
#pragma once

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/report/page.h"
#include "apps/report/run_report.h"
#include "tutti/loopclosure/ground_truth.h"

namespace tutti::report {

using Json = nlohmann::ordered_json;

/// A number with so many decimals, so that files stay small; null where it is not finite.
inline Json Rounded(double value, int decimals) {
  if (!std::isfinite(value)) return Json();
  const double unit = std::pow(10.0, decimals);
  return std::round(value * unit) / unit;
}

/// At most `most` indices of a list of `size`, evenly, the first and the last among them.
std::vector<std::size_t> Thinned(std::size_t size, std::size_t most);

/// Which of the images that the detector was asked about show the same place, by the reference poses.
struct KnownLoops {
  std::string rule;                    ///< in words; empty: nobody knows, and the rest is empty
  LoopGroundTruth truth;               ///< row and column: position in `images`
  std::vector<std::size_t> images;     ///< indices of DetectionLog::detections with a reference pose
  std::map<std::int64_t, int> row_of;  ///< by input frame
};
KnownLoops FindKnownLoops(const RunResult& result, const DetectionLog& log);

/// {"rule", "rows_with_loop", "curves": [{"name", "recall", "precision", "area", "recall_at_100"}]}; null
/// without known loops.
Json PrecisionRecallJson(const RunResult& result, const DetectionLog& log, const KnownLoops& known);

/// What became of a loop, for colours.
enum class Outcome { kAccepted, kFalse, kRejected, kMissed };
const char* ToString(Outcome outcome);

/// A loop of the map or of the gallery.
struct ShownLoop {
  Outcome outcome = Outcome::kAccepted;
  std::int64_t query = -1, candidate = -1;  ///< input frames
  double query_stamp_s = 0, candidate_stamp_s = 0;
  double hypothesis = 0, probability = 0;  ///< H; that it is a loop
  int inliers = 0, matches = 0;
  std::string reason;
  const LoggedDetection* detection = nullptr;  ///< null: the detector was not asked
};

/// All proposed loops, and (with known loops) the images that have a loop but no accepted one.
std::vector<ShownLoop> ShownLoops(const RunResult& result, const DetectionLog& log, const KnownLoops& known);

/// What the detector believed, and why; null if it was asked less than twice. Thinned out to at most 220
/// columns, each the one of its images that says most (verified, else proposed, else the largest hypothesis),
/// and as many rows of places, each with the largest value of its images:
///   "cells", "threshold", "loop_threshold", "first_stamp_s"; times are relative to it [s]
///   "t": of the columns; "place_t": of the rows
///   "maps": [{"name", "q"}]: the posterior of members and ensemble, one byte round(255 sqrt(p)) for a cell,
///     row by row, base64
///   "evidence": {"zero", "step", "maps": [{"name", "q"}]}: ln of the likelihoods of the members and (rule
///     joint) the ensemble in the same cells, (byte - zero) step; byte 0: no place there yet, or the member
///     sat the image out
///   "images": for each column what was decided: "query", "new" (p of a new place), "candidate", its
///     "row" (-1: none) and "posterior", "outcome" ("accepted", "false", "rejected", or "none": not
///     proposed), "missed" (the ground truth has a loop there), "probability" (null: not proposed), "reason"
///     (empty: accepted), "geometry" (null: it was not asked) with "place", "row", "mass", "matches",
///     "inliers", "coverage", "log_nfa", "spread" as in Verification, and "members": for each null (it sat
///     out) or [weight, H, best, posterior at the candidate]; places are input frames
///   "hypothesis_t", "hypotheses": [{"name", "h"}], "weights": [{"name", "w"}] (of the members, with the sum
///   1)
Json PosteriorJson(const RunResult& result, const DetectionLog& log, const std::vector<ShownLoop>& loops);

/// Pictures of some of each outcome: {"note", "entries": [{"outcome", "title", "text", "picture"}]}.
Json GalleryJson(const RunResult& result, const std::vector<ShownLoop>& loops);

}  // namespace tutti::report
