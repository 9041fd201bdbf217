// The folder that results go into. Nothing that tutti did not write is touched, and an earlier result stays
// until a new one is complete.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace tutti {

/// One file of a result.
struct OutputFile {
  std::string name;
  std::function<void(const std::filesystem::path&)> write;  ///< throws if it can't be written in full
};

/// What a command leaves in its folder.
struct OutputLayout {
  bool (*is_result)(const std::filesystem::path& entry) = nullptr;  ///< of files and folders of a result
  /// JSON file that comes last: where it is, the result is complete, unless it says "finished": false.
  std::string last;
  std::string key;                ///< that this file has, by which it is known as tutti's
  std::vector<std::string> live;  ///< files that grow while the command runs; gone when it has ended
  /// True for entries that may be inside and are left alone, as results of their own. May be null.
  bool (*is_part)(const std::filesystem::path& entry) = nullptr;
  std::vector<std::string> until_finished = {};  ///< as live, but they stay where the command ended early
  const char* option = "--out";                  ///< that the folder was given with, for messages
  bool known = false;                            ///< that the folder is tutti's, whether it has `last` or not

  /// All files but those of a result.
  std::vector<std::string> Passing() const;
};

/// Holds the folder for one process. New files wait in a hidden folder inside and are moved into place
/// together, so a process that is killed leaves the earlier result as it was; if it is killed between the
/// first and the last move, the next one on this folder moves the rest.
class OutputFolder {
 public:
  /// Makes the folder, proves that it can be written to and has room, and locks it. `keep`: an earlier result
  /// is not replaced but moved into a folder inside, 1, 2, ... `own`: one more file that may be there. Throws
  /// InputError that says what to do, before anything changed: no folder can be made, another process holds
  /// it, it has files that tutti did not write, or links where files are written.
  OutputFolder(std::filesystem::path folder, OutputLayout layout, bool keep = false,
               const std::optional<std::filesystem::path>& own = std::nullopt);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// What the constructor would throw of the folder itself, for the time before long work: no folder can be
  /// made there, it may not be written to, or it has files that tutti did not write. Leaves nothing behind.
  static void Check(const std::filesystem::path& folder, const OutputLayout& layout,
                    const std::optional<std::filesystem::path>& own = std::nullopt);

  const std::filesystem::path& path() const { return folder_; }

  /// Where files of the new result wait, for those that grow while the command runs. Throws InputError.
  const std::filesystem::path& Staging();
  /// Writes a file of the new result to where it waits. What goes wrong stands in failures().
  void Write(const OutputFile& file) noexcept;
  /// One line for each file that could not be written, with the reason.
  const std::vector<std::string>& failures() const { return failures_; }

  /// Moves the new result into place; to be called once, after the last file. One that is not `finished`, or
  /// lacks a file, never replaces a complete earlier one: it goes into the folder "unfinished" inside.
  /// Returns where it is. Throws InputError if that fails.
  std::filesystem::path Finish(bool finished);

 private:
  std::vector<std::filesystem::path> Results() const;
  void RefuseLinks() const;
  void Lock();
  void CheckRoom() const;
  std::filesystem::path NextNumber() const;
  void KeepLeftovers() const;
  void Enter() const;
  void RemoveParts() const;

  std::filesystem::path folder_, staging_;
  OutputLayout layout_;
  bool keep_;
  int lock_ = -1;
  std::vector<std::string> failures_;
};

/// Throws InputError with these lines, unless there are none; `rest`: where everything else is.
void ThrowFailures(const std::vector<std::string>& failures, const std::filesystem::path& rest);

/// Throws InputError if `file`, which the command reads, lies in `folder`, which it writes.
void RefuseToReplace(const std::filesystem::path& folder, const std::filesystem::path& file);

}  // namespace tutti
