// The commands of `tutti`, and how its two programs read a command line.
//
// `tutti` has the commands that read no images. It starts in milliseconds, since OpenCV's image readers with
// their two hundred libraries are in `tutti-images`, which has the other commands. Users call `tutti` alone:
// it becomes the other program for those (HandOver in main.cc).
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>

namespace tutti::cli {

/// Adds the options of a command, and a callback that does the work, sets the exit status, and may throw
/// InputError, which RunProgram prints as one line. Names and sentences: program.cc.
using SetUp = void(CLI::App& command, int& exit_code);
SetUp SetUpRun, SetUpLocalize, SetUpMerge, SetUpExport, SetUpDense, SetUpMap, SetUpCalibrateCheck,
    SetUpEvaluate, SetUpConvert, SetUpPlot, SetUpClose, SetUpCompare, SetUpCollect, SetUpLoops,
    SetUpCompareLoops, SetUpOptimize, SetUpGenerate, SetUpDemo;

/// Reads the command line, calls the command, and returns the exit status of the process. `own`: the commands
/// of this program, by name; each is in the list of all commands, which the help shows. A command of the list
/// that is not this program's own is what `other` is for, which returns the exit status; null: there are no
/// others.
int RunProgram(int argc, char** argv, const std::map<std::string, SetUp*>& own, int (*other)(char** argv));

}  // namespace tutti::cli
