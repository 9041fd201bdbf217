// Lines of numbers in text files, with errors that name file and line. Internal.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tutti/core/trajectory.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// Throws InputError: "file:line: what".
[[noreturn]] void FailAt(const std::filesystem::path& file, std::size_t line, const std::string& what);

/// True for a line that begins with '#' or '%'.
bool IsComment(const std::string& text);

/// Takes a line as it is, before it is split; true: it is no line of numbers.
using TakesLine = std::function<bool(const std::string& text)>;

/// Calls `use` for each line that carries data; '#' starts a comment, words are parted by blanks, tabs,
/// commas and semicolons. `names` goes first.
void ForEachLine(const std::filesystem::path& file,
                 const std::function<void(std::size_t line, const std::vector<std::string>& words)>& use,
                 const TakesLine& names = IsComment);

/// The word as a number of sane size.
double NumberAt(const std::filesystem::path& file, std::size_t line, const std::string& word);

/// From two words, in metres and degrees.
MotionSigma SigmaAt(const std::filesystem::path& file, std::size_t line, const std::string& translation,
                    const std::string& rotation);

}  // namespace tutti::internal
#pragma GCC visibility pop
