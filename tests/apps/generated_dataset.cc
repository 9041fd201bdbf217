#include "tests/apps/generated_dataset.h"

#include <unistd.h>

#include <system_error>

#include "data/synthetic/synthetic_writer.h"

namespace tutti::testing {

namespace fs = std::filesystem;

GeneratedDataset::GeneratedDataset(const std::string& name, const SyntheticOptions& options)
    : path_(fs::temp_directory_path() / ("tutti-" + name + "-" + std::to_string(getpid()))) {
  SyntheticWriteOptions write;
  write.threads = 2;
  WriteSyntheticDataset(SyntheticWorld(options), path_, write);
}

GeneratedDataset::~GeneratedDataset() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace tutti::testing
