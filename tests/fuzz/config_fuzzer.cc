// Configurations of runs: any text gives a configuration whose every key can be set to the value that it has,
// or an InputError. The first byte chooses: a YAML file, or assignments as on the command line, a line each.
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/fuzz/memory_file.h"
#include "tutti/core/error.h"
#include "tutti/slam/config.h"

namespace {

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  tutti::RunConfig config;
  try {
    if (data[0] % 2 == 0) {
      config = tutti::ParseConfig(text, "fuzz");
    } else {
      tutti::SetOptions(Lines(text), config);
    }
  } catch (const tutti::InputError&) {
    return 0;
  }
  tutti::DescribeConfig(config);
  return 0;
}
