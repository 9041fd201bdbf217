// Output of `tutti loops`: results.json, hypotheses.csv and the table on the terminal.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tutti/loopclosure/detector.h"
#include "tutti/loopclosure/evaluation.h"
#include "tutti/loopclosure/ground_truth.h"

namespace tutti::cli {

/// One image's outcome.
struct LoopRow {
  std::string file;  ///< name of the image
  bool read = true;  ///< false: the file is damaged; the row stays in the denominator
  LoopResult result;
  double ms = 0;  ///< time of Detect [ms]
};

/// Everything about one run.
struct LoopRun {
  LoopDetectorOptions options;
  std::string images;
  int stride = 1;
  LoopGroundTruth truth;
  std::vector<LoopRow> rows;
};

/// Writes both files into `folder` (made if missing) and prints the table. Throws InputError if the folder
/// can't be written.
void WriteLoopRun(const LoopRun& run, const std::filesystem::path& folder);

}  // namespace tutti::cli
