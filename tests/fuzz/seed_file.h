// What the programs that make seeds have in common.
#pragma once

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace tutti::fuzz {

/// The one argument, a folder, which is made.
inline std::filesystem::path SeedFolder(int argc, char** argv) {
  if (argc != 2) throw std::logic_error("needs one argument, the folder of the seeds");
  std::filesystem::create_directories(argv[1]);
  return argv[1];
}

inline void WriteSeed(const std::filesystem::path& file, const std::string& bytes) {
  if (!(std::ofstream(file, std::ios::binary) << bytes).flush())
    throw std::logic_error("a seed can't be written");
}

}  // namespace tutti::fuzz
