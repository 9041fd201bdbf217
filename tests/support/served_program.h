// A program whose libraries take long to load, loaded once for many calls.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tutti::testing {

constexpr int kServedStreams = 4;  ///< input, output, errors, and where the wait status goes

/// Starts a copy of `program`, which the first call has loaded with serve_main.cc before it, with these words
/// (the first is its name), in this process's folder and environment; its two outputs go to `output`. Returns
/// what EndServed takes. Thread-safe.
int BeginServed(const std::filesystem::path& program, const std::vector<std::string>& words, int output);
/// Waits for its end, and returns what waitpid says of it.
int EndServed(int served);

/// Can a copy stand for a new process? Not while files may not grow: copies do not have that limit; and not
/// with the thread sanitizer, which lets no copy start threads.
bool CanBeServed();

}  // namespace tutti::testing
