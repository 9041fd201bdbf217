// A synthetic data set on disk, for all tests of a program.
#pragma once

#include <filesystem>
#include <string>

#include "data/synthetic/synthetic_options.h"

namespace tutti::testing {

/// Written when it is made, and gone with it. As a static one it lasts as long as the program; a ctest run
/// starts one program per test.
class GeneratedDataset {
 public:
  /// `name`: of the folder, behind which the process id follows.
  GeneratedDataset(const std::string& name, const SyntheticOptions& options);
  ~GeneratedDataset();
  GeneratedDataset(const GeneratedDataset&) = delete;
  GeneratedDataset& operator=(const GeneratedDataset&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace tutti::testing
