// How every text file that is given to tutti is read: a line at a time, within bounds; lines of numbers, with
// errors that name file and line. Internal.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "tutti/core/trajectory.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// Throws InputError, which ends with `advice`, if `file` is not there, is a folder, or is a pipe in a
/// folder, at which one would wait without end for somebody to write. Pipes of a shell, such as <(zcat
/// poses.gz), are files.
void RequireFile(const std::filesystem::path& file, const std::string& advice);

/// A text file, line by line. A file can claim any size and /dev/zero never ends; what is no text or has a
/// line beyond all reason is refused there, so that memory is bounded. Throws InputError, which names file
/// and line.
class TextReader {
 public:
  static constexpr std::size_t kMostLineBytes = std::size_t{64} << 20;  // a loop matrix has rows of 100 kB

  /// `advice` ends the message if the file can't be opened: "give the summary.json of a run".
  explicit TextReader(std::filesystem::path file,
                      const std::string& advice = "check the path and that it is readable");

  /// The next line without its line feed; false after the last one. The three bytes with which editors of
  /// Windows begin a text in UTF-8 are left out.
  bool Next(std::string& line);
  /// Number of the line that Next gave last, counted from 1.
  std::size_t number() const { return number_; }

 private:
  bool Fill();
  [[noreturn]] void Fail(const std::string& what) const;

  std::filesystem::path file_;
  std::ifstream in_;
  std::vector<char> block_;
  std::size_t begin_ = 0, end_ = 0;  // of what is left in the block
  std::size_t number_ = 0;
};

/// All of a text file, lines ended by a line feed. Throws InputError as TextReader, and if it is larger than
/// `most_bytes`.
std::string ReadText(const std::filesystem::path& file, const std::string& advice, std::size_t most_bytes);

/// The beginning of a word that may be as long as a file, for a message.
std::string Excerpt(const std::string& word);

/// The first word such as "0,25" of a line whose columns are separated by blanks; empty if there is none.
std::string DecimalComma(const std::string& line);

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
