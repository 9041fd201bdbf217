// What the man page and the completion of shells are made of (apps/manual).
#pragma once

#include <CLI/CLI.hpp>

namespace tutti::cli {

/// Adds --describe, which no help shows: prints the parser's options and commands as JSON, and ends. The
/// parser must live as long as it is used.
void AddDescribeFlag(CLI::App& parser);

}  // namespace tutti::cli
