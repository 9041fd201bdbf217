#include "apps/manual/command_page.h"

#include <nlohmann/json.hpp>

namespace tutti::manual {

CommandPage ParsePage(const std::string& json) {
  const nlohmann::json in = nlohmann::json::parse(json);
  CommandPage page;
  page.name = in.at("name");
  page.text = in.at("text");
  page.footer = in.at("footer");
  for (const nlohmann::json& option : in.at("options")) {
    Argument argument;
    argument.names = option.at("names").get<std::vector<std::string>>();
    argument.positional = option.at("positional");
    argument.value = option.at("value");
    argument.choices = option.at("choices").get<std::vector<std::string>>();
    argument.value_optional = option.at("value_optional");
    argument.several = option.at("several");
    argument.required = option.at("required");
    argument.default_value = option.at("default");
    argument.text = option.at("text");
    page.arguments.push_back(argument);
  }
  for (const nlohmann::json& command : in.at("commands")) {
    CommandPage known;
    known.name = command.at("name");
    known.text = command.at("text");
    page.commands.push_back(known);
  }
  return page;
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

}  // namespace tutti::manual
