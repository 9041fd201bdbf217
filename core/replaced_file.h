// One rule for all files that are written: they are complete, or what was there before is untouched. Not
// installed.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <string_view>

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// A file that is written under a name of its own beside its place, which it takes in Commit. A file that was
/// there gives the new one its mode; a symbolic link stays, and the file that it leads to is written.
/// Folders, devices, pipes and files without permission to write are refused. Every function throws
/// InputError, with the name of the file.
class ReplacedFile {
 public:
  /// Makes the file beside, empty.
  explicit ReplacedFile(const std::filesystem::path& file);
  /// Without Commit nothing is left.
  ~ReplacedFile();
  ReplacedFile(const ReplacedFile&) = delete;
  ReplacedFile& operator=(const ReplacedFile&) = delete;

  /// Where the content goes.
  const std::filesystem::path& part() const { return part_; }
  /// Whose place it takes.
  const std::filesystem::path& target() const { return target_; }
  void Commit();

 private:
  std::string name_;
  std::filesystem::path target_, part_;
  bool committed_ = false;
};

/// How the names of all that are being written beside a file begin; the number of the process follows.
std::string PartPrefix(const std::filesystem::path& file);

/// Writes a whole file, as ReplacedFile. A pipe, a terminal and the like (/dev/stdout, >(program)) get the
/// bytes themselves. Throws InputError.
void WriteFile(const std::filesystem::path& file, std::string_view bytes);

/// What a writer needs of its file.
enum class Needs {
  kBytes,  ///< WriteFile: a stream will do
  kFile    ///< ReplacedFile
};

/// Throws InputError where writing would: before long work.
void CheckWritable(const std::filesystem::path& file, Needs needs);

/// Throws InputError that says why a file can't be written: `error` is of <cerrno>, or 0.
[[noreturn]] void FailToWrite(const std::string& file, int error);

}  // namespace tutti::internal
#pragma GCC visibility pop
