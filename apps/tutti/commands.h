// The commands of `tutti`. Each function adds the options of one to its sub-command; the callback does the
// work, sets exit_code, and may throw InputError, which RunProgram prints as one line. Names and sentences:
// program.cc.
#pragma once

#include <CLI/CLI.hpp>

namespace tutti::cli {

void SetUpRun(CLI::App& command, int& exit_code);
void SetUpLocalize(CLI::App& command, int& exit_code);
void SetUpMerge(CLI::App& command, int& exit_code);
void SetUpExport(CLI::App& command, int& exit_code);
void SetUpMap(CLI::App& command, int& exit_code);
void SetUpCalibrateCheck(CLI::App& command, int& exit_code);
void SetUpEvaluate(CLI::App& command, int& exit_code);
void SetUpConvert(CLI::App& command, int& exit_code);
void SetUpPlot(CLI::App& command, int& exit_code);
void SetUpClose(CLI::App& command, int& exit_code);
void SetUpCompare(CLI::App& command, int& exit_code);
void SetUpCollect(CLI::App& command, int& exit_code);
void SetUpLoops(CLI::App& command, int& exit_code);
void SetUpCompareLoops(CLI::App& command, int& exit_code);
void SetUpOptimize(CLI::App& command, int& exit_code);
void SetUpGenerate(CLI::App& command, int& exit_code);
void SetUpDemo(CLI::App& command, int& exit_code);

}  // namespace tutti::cli
