// The configurations for public data sets (data/configs), which are part of the program: they are there
// wherever it was built, copied or installed. Not installed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// Their names, in order: "7scenes", "euroc_mono", ...
std::vector<std::string> ExampleConfigNames();

/// The text of one, by its name; nothing if there is none of this name.
std::optional<std::string> ExampleConfig(const std::string& name);

}  // namespace tutti::internal
#pragma GCC visibility pop
