// What libraries print on stderr: five lines of a kind, and how many more there were.
#pragma once

#include <cstdio>
#include <map>
#include <memory>
#include <mutex>
#include <streambuf>
#include <string>

namespace tutti::cli {

/// While it lives, stderr and std::cerr are its own, so that readers of images and videos, which print a line
/// for each damaged one, don't fill the screen. Lines that differ in their numbers alone are of one kind.
/// tutti's own messages go to internal::StandardError().
class ForeignLines {
 public:
  /// `quiet`: nothing of it is printed.
  explicit ForeignLines(bool quiet);
  ~ForeignLines();
  ForeignLines(const ForeignLines&) = delete;
  ForeignLines& operator=(const ForeignLines&) = delete;

 private:
  struct Kind {
    std::string first;
    std::size_t count = 0;
  };
  void Take(const char* text, std::size_t size);
  void EndLine();

  bool quiet_;
  std::FILE* before_ = nullptr;  // stderr
  std::FILE* stream_ = nullptr;  // in its stead; null where the C library has none of its kind
  std::unique_ptr<std::streambuf> buffer_;
  std::streambuf* cerr_ = nullptr;  // std::cerr's own
  std::mutex mutex_;
  std::string line_;                   // that has not ended; guarded by mutex_, as all below
  std::map<std::string, Kind> kinds_;  // by their text without numbers
};

}  // namespace tutti::cli
