// The one exception that tutti's libraries throw: for input that can't be used.
#pragma once

#include <stdexcept>
#include <string>

#pragma GCC visibility push(default)
namespace tutti {

/// Bad input: a missing file, a damaged line, a wrong setting. The message names the file and line (or the
/// frame) and says what to do. Programs catch it in main, print it as one line and exit with a non-zero
/// status. Algorithms never throw it for hard images; they return a result that says why they failed.
class InputError : public std::runtime_error {
 public:
  explicit InputError(const std::string& message) : std::runtime_error(message) {}
};

}  // namespace tutti
#pragma GCC visibility pop
