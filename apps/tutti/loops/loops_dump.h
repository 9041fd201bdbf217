// What each candidate looked like to the detector, as files: for those who want to learn from it.
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

}  // namespace tutti::cli
