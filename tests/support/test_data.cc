#include "tests/support/test_data.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace tutti::testing {
namespace {

// Removes what the tests wrote, once all of them have passed.
class FolderOfThisProcess : public ::testing::EmptyTestEventListener {
 public:
  FolderOfThisProcess() {
    std::string name = std::filesystem::temp_directory_path() / "tutti_test_XXXXXX";
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error(name + ": can't be made");
    path_ = name;
  }

  const std::filesystem::path& path() const { return path_; }

  void OnTestProgramEnd(const ::testing::UnitTest& tests) override {
    std::error_code error;
    if (tests.Passed()) std::filesystem::remove_all(path_, error);
  }

 private:
  std::filesystem::path path_;
};

const std::filesystem::path& ScratchFolder() {
  static const FolderOfThisProcess* const kFolder = [] {
    auto* folder = new FolderOfThisProcess;
    ::testing::UnitTest::GetInstance()->listeners().Append(folder);  // which deletes it
    return folder;
  }();
  return kFolder->path();
}

}  // namespace

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
  std::filesystem::path folder =
      ScratchFolder() / (std::string(info->test_suite_name()) + "." + info->name());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

std::string BytesOf(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::filesystem::path FreshFile(const std::string& name, const std::string& content) {
  std::filesystem::path file = FreshFolder() / name;
  std::ofstream(file, std::ios::binary) << content;
  return file;
}

}  // namespace tutti::testing
