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

}  // namespace tutti::internal
