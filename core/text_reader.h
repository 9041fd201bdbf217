// How every text file that somebody gives us is read: a line at a time, within bounds. Internal.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

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
  /// Of the line that Next gave last, counted from 1.
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

}  // namespace tutti::internal
#pragma GCC visibility pop
