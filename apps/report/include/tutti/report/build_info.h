// What the program was built with.
#pragma once

#include <nlohmann/json.hpp>

namespace tutti {

/// Name of each part -> its version.
nlohmann::ordered_json BuildInfo();

}  // namespace tutti
