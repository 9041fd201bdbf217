// A loop over independent tasks on a few threads.
#pragma once

#include <functional>

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// Runs task(0) .. task(count - 1), each once, on at most `threads` threads (the caller's among them), and
/// waits. Tasks must not share anything that they write. The first exception, by task number, is thrown on.
void RunParallel(int count, int threads, const std::function<void(int)>& task);

}  // namespace tutti
#pragma GCC visibility pop
