// How a run ended, for the shell.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "apps/run/run_result.h"

namespace tutti::cli {

/// --require: what a run's health must be at least; `word` holds it ("good", "doubtful", "failed").
void AddRequireOption(CLI::App& command, std::string& word);

/// Prints the health of a run. 130: ended by Ctrl-C, as shells say it; 1: no frame has a pose, or the health
/// is below `required`. Says why on standard error.
int ExitCode(const RunResult& result, const std::string& required);

}  // namespace tutti::cli
