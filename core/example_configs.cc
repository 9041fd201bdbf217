#include "core/example_configs.h"

#include <map>

namespace tutti {
namespace assets {
std::string ExampleConfigs();  // made by CMake: each behind a line "==> NAME"
}

namespace internal {
namespace {

std::map<std::string, std::string> Configs() {
  constexpr const char* kMark = "==> ";
  const std::string all = assets::ExampleConfigs();
  std::map<std::string, std::string> configs;
  for (std::size_t at = 0; at < all.size();) {
    const std::size_t name = at + std::string(kMark).size(), line = all.find('\n', name);
    at = std::min(all.find(std::string("\n") + kMark, line), all.size() - 1) + 1;
    configs[all.substr(name, line - name)] = all.substr(line + 1, at - line - 1);
  }
  return configs;
}

}  // namespace

std::vector<std::string> ExampleConfigNames() {
  std::vector<std::string> names;
  for (const auto& [name, text] : Configs()) names.push_back(name);
  return names;
}

std::optional<std::string> ExampleConfig(const std::string& name) {
  const std::map<std::string, std::string> configs = Configs();
  const auto found = configs.find(name);
  return found == configs.end() ? std::nullopt : std::optional<std::string>(found->second);
}

}  // namespace internal
}  // namespace tutti
