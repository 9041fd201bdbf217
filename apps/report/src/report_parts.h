// The parts of a run's report.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tutti/loopclosure/ground_truth.h"
#include "tutti/pipeline/run_result.h"
#include "tutti/report/base64.h"
#include "tutti/report/detection_log.h"

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

/// {"t", "place_t", "threshold", "maps": [{"name", "columns", "rows", "q"}], "hypotheses"}: the largest
/// posterior in each cell as one byte round(255 sqrt(p)), base64, row by row (row: place); null if the
/// detector was never asked.
Json PosteriorJson(const RunResult& result, const DetectionLog& log);

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

/// Pictures of some of each outcome: {"note", "entries": [{"outcome", "title", "text", "picture"}]}.
Json GalleryJson(const RunResult& result, const std::vector<ShownLoop>& loops);

/// Stages, frame times, processor time, memory.
Json TimingJson(const RunResult& result);
/// Sections of the configuration, and what the program was built with.
Json ConfigurationJson(const RunResult& result);

}  // namespace tutti::report
