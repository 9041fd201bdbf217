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

/// stderr as it was when this was first called. Libraries print to stderr as it is now, and not always to be
/// read (ForeignLines).
std::FILE* StandardError();

/// The text, Printable, with a line feed at its end. A line that is longer than those of `out`, where that is
/// a terminal, is broken between words and goes on below, 2 columns further in; elsewhere (a pipe, a file) it
/// stays one line.
std::string Message(std::string_view text, std::FILE* out = StandardError(),
                    Breaks breaks = Breaks::kOfMessage);
/// Prints a Message on StandardError: "tutti: ", and the text as printf makes it.
void Say(const char* format, ...) __attribute__((format(printf, 1, 2)));

}  // namespace tutti::internal
#pragma GCC visibility pop
