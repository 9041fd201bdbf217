// A synthetic data set on disk, for tests of programs that read data sets.
#pragma once

#include <filesystem>

#include "data/synthetic/synthetic_options.h"

namespace tutti::testing {

/// Folder of the data set, written once for all tests (MadeOnce): copy what a test changes.
std::filesystem::path GeneratedDataset(const SyntheticOptions& options);

}  // namespace tutti::testing
