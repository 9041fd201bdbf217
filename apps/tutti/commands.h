// The sub-commands of `tutti`. Each function adds one to the parser; its callback does the work, sets
// exit_code, and may throw InputError, which main prints as one line.
#pragma once

#include <CLI/CLI.hpp>

namespace tutti::cli {

void AddRunCommand(CLI::App& app, int& exit_code);
void AddCalibrateCheckCommand(CLI::App& app, int& exit_code);
void AddEvaluateCommand(CLI::App& app, int& exit_code);
void AddConvertCommand(CLI::App& app, int& exit_code);
void AddPlotCommand(CLI::App& app, int& exit_code);
void AddCompareCommand(CLI::App& app, int& exit_code);
void AddCollectCommand(CLI::App& app, int& exit_code);
void AddLoopsCommand(CLI::App& app, int& exit_code);
void AddCompareLoopsCommand(CLI::App& app, int& exit_code);
void AddOptimizeCommand(CLI::App& app, int& exit_code);
void AddGenerateCommand(CLI::App& app, int& exit_code);
void AddDemoCommand(CLI::App& app, int& exit_code);

}  // namespace tutti::cli
