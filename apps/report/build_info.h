// What the program was built with.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace tutti {

/// Why this tutti was built without the chart library, and how to get it; empty if it has it.
std::string ChartLibraryMissing();

/// Name of each part -> its version.
nlohmann::ordered_json BuildInfo();

}  // namespace tutti
