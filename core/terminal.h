// How wide a terminal is, and text that fits it. Not installed.
#pragma once

#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// Columns of the terminal that `out` is; 80 where it is none (a pipe, a file), or does not say.
std::size_t TerminalColumns(std::FILE* out);

/// Lines of at most `columns` characters, broken between words; a longer word has a line of its own. Breaks
/// (\n) stay. An empty text has one empty line.
std::vector<std::string> WrapText(std::string_view text, std::size_t columns);

/// What of a text is a line of its own.
enum class Breaks {
  kOfMessage,  ///< only what a break and two blanks begin, as our messages have it
  kAll         ///< a table
};

/// A text with names that somebody else gave (files, topics, keys, recordings), so that a terminal shows it
/// and does nothing else: control characters, marks that turn the direction of writing, and bytes that are no
/// UTF-8 are spelled out (\x1b, \n, \u202e).
std::string Printable(std::string_view text, Breaks breaks = Breaks::kOfMessage);

}  // namespace tutti::internal
#pragma GCC visibility pop
