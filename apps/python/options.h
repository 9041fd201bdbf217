// Options as keywords: names, types, ranges and sentences are those of the YAML files' keys.
#pragma once

#include <string>

#include "apps/python/bindings.h"
#include "tutti/slam/config.h"

namespace tutti::python {

/// Sets what the keywords say, a struct within as a dict: features of `extraction` is extraction={"features":
/// 300}. `section`: of the YAML files that they are keys of; empty: keywords are whole sections. Raises
/// TypeError that names the nearest one for an unknown keyword; throws InputError for a value that is of
/// another type or out of its range.
void SetOptions(const std::string& function, const std::string& section, const py::dict& keywords,
                RunConfig& config);

/// The present values of a section, as SetOptions takes them.
py::dict OptionsOf(const RunConfig& config, const std::string& section);

/// What each keyword of a section does, for a docstring.
std::string DescribeOptions(const std::string& section, RunConfig defaults = {});

}  // namespace tutti::python
