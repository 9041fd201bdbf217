#include "core/example_configs.h"

#include <system_error>

namespace tutti::internal {
namespace fs = std::filesystem;

std::string ExampleConfigs() {
  std::error_code ignored;
  return ExampleConfigs(fs::read_symlink("/proc/self/exe", ignored).parent_path());
}

std::string ExampleConfigs(const fs::path& folder) {
  constexpr int kLevels = 3;  // lib/MACHINE/tutti
  fs::path above = folder;
  for (int i = 0; i < kLevels && above.has_relative_path(); ++i) {
    above = above.parent_path();
    const fs::path configs = above / TUTTI_DATA_FOLDER / "tutti" / "configs";
    std::error_code ignored;
    if (fs::is_directory(configs, ignored)) return configs.string();
  }
  return "data/configs";
}

fs::path ExampleConfig(const std::string& name) {
  constexpr int kLevels = 5;  // build/release/tests/apps/export
  fs::path usual = fs::path(ExampleConfigs()) / name;
  std::error_code ignored;
  if (fs::is_regular_file(usual, ignored)) return usual;
  fs::path above = fs::read_symlink("/proc/self/exe", ignored).parent_path();
  for (int i = 0; i < kLevels && above.has_relative_path(); ++i) {
    above = above.parent_path();
    fs::path file = above / "data" / "configs" / name;
    if (fs::is_regular_file(file, ignored)) return file;
  }
  return usual;
}

}  // namespace tutti::internal
