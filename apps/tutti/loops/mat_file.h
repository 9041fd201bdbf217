// Loop matrices in MATLAB's files, read by matio.
#pragma once

#include <filesystem>

#include "tutti/loopclosure/ground_truth.h"

namespace tutti::cli {

/// True if a file's name ends in .mat, or it begins as MATLAB's files do.
bool IsMatFile(const std::filesystem::path& file);

/// The first square matrix of numbers with more than one row, full or sparse, of a file of MATLAB 5 to 7;
/// labels as in LoopsFromMatrix. Throws InputError, with the name of the file, if it is damaged or holds
/// none.
LoopGroundTruth ReadMatLoops(const std::filesystem::path& file);

}  // namespace tutti::cli
