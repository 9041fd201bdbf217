// InputError in the words of Python.
#pragma once

#include <filesystem>
#include <string>

#include "tutti/core/error.h"

namespace tutti::python {

/// A file can't be opened or written: tutti.FileError, an OSError as well.
class FileError : public InputError {
 public:
  explicit FileError(const std::string& message) : InputError(message) {}
};

/// False for what is not there, and for what may not be read.
bool CanBeRead(const std::filesystem::path& path);

/// What `work` reads from `path`; an InputError since nothing is there becomes a FileError.
template <class Work>
auto Reading(const std::filesystem::path& path, Work work) {
  try {
    return work();
  } catch (const InputError& error) {
    if (CanBeRead(path)) throw;
    throw FileError(error.what());
  }
}

/// Runs `work`, which writes a file: each InputError is one of the file.
template <class Work>
void Writing(Work work) {
  try {
    work();
  } catch (const InputError& error) {
    throw FileError(error.what());
  }
}

/// A RuntimeWarning of Python's. May raise, where the user wants warnings to be errors.
void Warn(const std::string& text);

}  // namespace tutti::python
