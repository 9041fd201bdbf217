// What holds for every number on the command line.
#pragma once

#include <CLI/CLI.hpp>

namespace tutti::cli {

/// Has all options of the command that take a number refuse what can't be computed with: infinities, not a
/// number, magnitudes beyond 1e15 or (but for 0) below 1e-15, whole numbers beyond 64 bits, which the library
/// would cut off without a word, and more than 1024 threads.
void RefuseAbsurdNumbers(CLI::App& command);

}  // namespace tutti::cli
