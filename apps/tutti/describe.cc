#include "apps/tutti/describe.h"

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tutti/core/text.h"

namespace tutti::cli {
namespace {

// IsMember shows its words as TYPE:{one,two}.
std::vector<std::string> Choices(const std::string& type) {
  const std::size_t open = type.find('{');
  const std::size_t close = type.find('}');
  if (open == std::string::npos || close == std::string::npos) return {};
  return SplitText(std::string_view(type).substr(open + 1, close - open - 1), ",");
}

nlohmann::json Describe(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  if (names.empty()) names.push_back(option.get_name(true));
  const bool takes_value = option.get_items_expected_max() > 0;
  const std::string type = takes_value ? option.get_type_name() : "";
  return {{"names", names},
          {"positional", option.get_positional()},
          {"value", type.substr(0, type.find(':'))},
          {"choices", Choices(type)},
          {"value_optional", takes_value && option.get_items_expected_min() == 0},
          {"several", option.get_items_expected_max() > 1},
          {"required", option.get_required()},
          {"default", option.get_default_str()},
          {"text", option.get_description()}};
}

std::string Describe(const CLI::App& parser) {
  nlohmann::json out = {{"name", parser.get_name()},
                        {"text", parser.get_description()},
                        {"footer", parser.get_footer()},
                        {"options", nlohmann::json::array()},
                        {"commands", nlohmann::json::array()}};
  for (const CLI::Option* option : parser.get_options()) {
    if (!option->get_group().empty()) out["options"].push_back(Describe(*option));
  }
  for (const CLI::App* command : parser.get_subcommands({}))
    out["commands"].push_back({{"name", command->get_name()}, {"text", command->get_description()}});
  return out.dump(1);
}

}  // namespace

void AddDescribeFlag(CLI::App& parser) {
  // The library prints the message of this exception and exits with 0, whatever else is missing.
  parser.add_flag_callback("--describe", [&parser] { throw CLI::CallForVersion(Describe(parser), 0); })
      ->group("");
}

}  // namespace tutti::cli
