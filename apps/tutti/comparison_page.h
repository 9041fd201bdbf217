// A comparison of runs as report.html.
#pragma once

#include <filesystem>
#include <string>

#include "apps/tutti/comparison.h"

namespace tutti::cli {

/// The page of a comparison, or removes an older one if pages are left out. `runs` without a report.json are
/// in the table alone.
void WriteComparisonReport(const std::filesystem::path& file, const std::string& title,
                           const Comparison& comparison);

}  // namespace tutti::cli
