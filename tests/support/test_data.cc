#include "tests/support/test_data.h"

#include <unistd.h>

#include <cstdlib>
#include <fstream>

namespace tutti::testing {

std::filesystem::path SourceDir() { return TUTTI_SOURCE_DIR; }

std::filesystem::path RealData(const std::string& name) {
  const char* root = std::getenv("TUTTI_DATA");
  const std::filesystem::path base =
      root != nullptr && *root != 0 ? std::filesystem::path(root) : SourceDir() / "../shared/data";
  std::error_code error;
  const std::filesystem::path path = base / name;
  return std::filesystem::exists(path, error) ? path : std::filesystem::path();
}

std::filesystem::path FreshFolder() {
  const ::testing::TestInfo* info = ::testing::UnitTest::GetInstance()->current_test_info();
  std::filesystem::path folder = std::filesystem::temp_directory_path() /
                                 ("tutti_test_" + std::to_string(::getpid())) /
                                 (std::string(info->test_suite_name()) + "." + info->name());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

std::filesystem::path FreshFile(const std::string& name, const std::string& content) {
  std::filesystem::path file = FreshFolder() / name;
  std::ofstream(file, std::ios::binary) << content;
  return file;
}

}  // namespace tutti::testing
