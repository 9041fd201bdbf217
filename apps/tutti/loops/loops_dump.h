// What each candidate looked like to the detector, and what each member believed of each location, as files:
// for those who want to learn from it.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "apps/tutti/loops/loops_output.h"
#include "core/replaced_file.h"

namespace tutti::cli {

/// Writes dump_candidates.csv and dump_verification.csv (docs/outputs.md), image by image: all of a long walk
/// would not fit into memory. Needs results of a detector with LoopDetectorOptions::keep_evidence.
class LoopsDump {
 public:
  /// Opens both files in `folder` (made if missing) and writes their headers. Throws InputError if it can't.
  LoopsDump(const std::filesystem::path& folder, const std::vector<std::string>& members);
  /// Appends the lines of one image of the run; `truth` is for all its images.
  void Add(const LoopRun& run, const LoopResult& result, const LoopGroundTruth& truth);
  /// Appends what was decided later about an image: its verification, with `late` 1.
  void AddLate(const LoopRun& run, const LoopResult& result, const LoopGroundTruth& truth);
  /// To be called at the end: then the files are there. Throws InputError if the files could not be written
  /// in full.
  void Finish();

 private:
  internal::ReplacedFile candidates_file_, verification_file_;
  std::ofstream candidates_, verification_;
};

/// Writes `file`: "image,location,truth,combined,<member>..." for every pair that is a loop (truth 255; 128:
/// ignored, 0: none) or where one of the posteriors is at least 1e-4. Needs a run with
/// LoopDetectorOptions::keep_posterior. Throws InputError if it can't be written.
void WritePosteriors(const LoopRun& run, const std::filesystem::path& file);

}  // namespace tutti::cli
