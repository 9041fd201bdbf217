// The commands that read images are in a program of their own.
#pragma once

namespace tutti::cli {

/// Becomes tutti-images, with these words: the same process, so that input, output, signals and the exit
/// status are the program's own. It lies beside this program, or where it is installed. Comes back only if it
/// can't be started: says where it was looked for, and returns 1.
int HandOver(char** argv);

}  // namespace tutti::cli
