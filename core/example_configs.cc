#include "core/example_configs.h"

#include <system_error>

namespace tutti::internal {
namespace fs = std::filesystem;

std::string ExampleConfigs() {
  std::error_code ignored;
  return ExampleConfigs(fs::read_symlink("/proc/self/exe", ignored).parent_path());
}

std::string ExampleConfigs(const fs::path& folder) {
  constexpr int kInstalled = 3;  // lib/MACHINE/tutti
  constexpr int kBuilt = 5;      // build/release/tests/apps/export
  const fs::path here = fs::path("data") / "configs";
  fs::path above = folder, source;
  std::error_code ignored;
  for (int i = 0; i < kBuilt && above.has_relative_path(); ++i) {
    above = above.parent_path();
    const fs::path configs = above / TUTTI_DATA_FOLDER / "tutti" / "configs";
    if (i < kInstalled && fs::is_directory(configs, ignored)) return configs.string();
    if (source.empty() && fs::is_regular_file(above / here / "images.yaml", ignored)) source = above / here;
  }
  // The shorter name, where it is one.
  if (source.empty() || fs::equivalent(source, here, ignored)) return here.string();
  return source.string();
}

}  // namespace tutti::internal
