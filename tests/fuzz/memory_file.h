// A file in memory for readers that take a path: a disk would be the slowest part of fuzzing.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>

namespace tutti::fuzz {

/// Path of a file that holds these bytes until the next call. Linux only (memfd_create).
inline std::filesystem::path MemoryFile(const std::uint8_t* data, std::size_t size) {
  static const int file = memfd_create("fuzz", 0);
  static const std::string path = "/proc/self/fd/" + std::to_string(file);
  const bool written =
      file >= 0 && ftruncate(file, 0) == 0 && pwrite(file, data, size, 0) == static_cast<ssize_t>(size);
  if (!written) std::abort();  // the machine's fault: stop rather than test nothing
  return path;
}

/// A path of this process' own, for what has to be written: memory, too.
inline std::filesystem::path ScratchPath(const std::string& name) {
  return "/dev/shm/tutti_fuzz_" + name + "_" + std::to_string(getpid());
}

}  // namespace tutti::fuzz
