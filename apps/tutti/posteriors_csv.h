// What each member believed of each location, as a file.
#pragma once

#include <filesystem>

#include "apps/tutti/loops/loops_output.h"

namespace tutti::cli {

/// Writes `file`: "image,location,truth,combined,<member>..." for every pair that is a loop (truth 255; 128:
/// ignored, 0: none) or where one of the posteriors is at least 1e-4. Needs a run with
/// LoopDetectorOptions::keep_posterior. Throws InputError if it can't be written.
void WritePosteriors(const LoopRun& run, const std::filesystem::path& file);

}  // namespace tutti::cli
