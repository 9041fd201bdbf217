// The progress line of a long run: on a terminal one line that updates, else a line about every tenth.
#pragma once

#include <cstddef>
#include <cstdio>
#include <map>
#include <string>

#include "core/stopwatch.h"
#include "core/terminal.h"

namespace tutti {

/// Writes to `out` (nullptr: silent). Never part of a result.
class Progress {
 public:
  /// `total` frames; 0: nobody knows how many. `columns`: width of a line; 0: that of the terminal.
  Progress(std::string title, std::size_t total, std::FILE* out = internal::StandardError(),
           std::size_t columns = 0);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `done` of `total` frames; `status` is free text (state, loops). The line never fills the last column.
  void Update(std::size_t done, const std::string& status);
  /// Work that can't be counted: title, `status` and the seconds so far, if it takes longer than a second.
  /// Where there is no terminal: a line after `first_s` [s], and whenever the time has doubled since the last
  /// one.
  void Say(const std::string& status, double first_s = 10);
  /// A message above the progress line. Of messages that say the same of one frame after the other five are
  /// printed, and Finish counts the rest: "tutti: 17 more " and `more` ("frames are skipped").
  void Note(const std::string& message, const std::string& more = "");
  void Finish();

 private:
  std::string Line(std::size_t done, const std::string& status) const;
  std::size_t Columns() const;

  std::string title_;
  std::size_t total_;
  std::FILE* out_;
  std::size_t columns_;  // 0: of the terminal, which may change
  bool terminal_ = false;
  bool line_open_ = false;
  std::size_t next_tenth_ = 1;
  std::map<std::string, std::size_t> noted_;  // messages by what more of them are
  double next_line_s_ = 0;
  internal::Stopwatch since_begin_, since_line_;
};

}  // namespace tutti
