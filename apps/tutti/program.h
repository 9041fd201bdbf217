// What the two programs of tutti have in common: the list of commands, and how a command line is read.
//
// `tutti` has the commands that read no images. It starts in milliseconds, since OpenCV's image readers with
// their two hundred libraries are in `tutti-images`, which has the other commands. Users call `tutti` alone:
// it becomes the other program for those (HandOver).
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>

namespace tutti::cli {

/// Adds the options of a command, and a callback that does the work, sets the exit status, and may throw
/// InputError, which is printed as one line.
using SetUp = void (*)(CLI::App& command, int& exit_code);

/// Reads the command line, calls the command, and returns the exit status of the process. `own`: the commands
/// of this program, by name; each is in the list of all commands, which the help shows. A command of the list
/// that is not this program's own is what `other` is for, which returns the exit status; null: there are no
/// others.
int RunProgram(int argc, char** argv, const std::map<std::string, SetUp>& own, int (*other)(char** argv));

}  // namespace tutti::cli
