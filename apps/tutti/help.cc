#include "apps/tutti/help.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "core/terminal.h"
#include "tutti/core/text.h"

namespace tutti::cli {
namespace {

using internal::WrapText;

constexpr std::size_t kNarrowest = 20;  // fewer columns can't be written in

std::string Paragraph(std::string text, std::size_t columns) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::string out;
  for (const std::string& line : WrapText(text, columns)) out += line + "\n";
  return text.empty() ? text : out;
}

// A list of many choices is a word longer than a line: it may be broken after its commas.
std::string WithBreaks(const std::string& name, std::size_t columns) {
  std::string out;
  for (std::string word : SplitText(name, " ")) {
    if (word.size() > columns) word = JoinText(SplitText(word, ","), ", ");
    out += (out.empty() ? "" : " ") + word;
  }
  return out;
}

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

WrappedHelp::WrappedHelp(std::size_t columns) : columns_(std::max(kNarrowest, columns)) {
  // Room for half of the options' names; the text must be readable beside them.
  column_width(columns_ >= 60 ? 26 : 6);
}

std::string WrappedHelp::make_description(const CLI::App* app) const {
  return Paragraph(CLI::Formatter::make_description(app), columns_) + "\n";
}

std::string WrappedHelp::make_footer(const CLI::App* app) const {
  return Paragraph(CLI::Formatter::make_footer(app), columns_);
}

std::string WrappedHelp::make_usage(const CLI::App* app, std::string name) const {
  return Paragraph(CLI::Formatter::make_usage(app, std::move(name)), columns_);
}

std::string WrappedHelp::make_subcommand(const CLI::App* command) const {
  return Entry(command->get_display_name(true), command->get_description());
}

std::string WrappedHelp::make_option(const CLI::Option* option, bool positional) const {
  return Entry(make_option_name(option, positional) + make_option_opts(option), make_option_desc(option));
}

std::string WrappedHelp::Entry(const std::string& name, const std::string& text) const {
  constexpr std::size_t kIndent = 2, kGap = 1;
  const std::size_t column = get_column_width();
  std::string out;
  std::size_t used = 0;  // of the last line
  for (const std::string& line : WrapText(WithBreaks(name, columns_ - 2 * kIndent), columns_ - 2 * kIndent)) {
    const std::string indent(out.empty() ? kIndent : 2 * kIndent, ' ');
    if (!out.empty()) out += "\n";
    out += indent + line;
    used = indent.size() + line.size();
  }
  for (const std::string& line : WrapText(text, columns_ - column)) {
    if (line.empty()) continue;
    if (used + kGap > column) {
      out += "\n";
      used = 0;
    }
    out += std::string(column - used, ' ') + line;
    used = columns_;
  }
  return out + "\n";
}

void AddDescribeFlag(CLI::App& parser) {
  // The library prints the message of this exception and exits with 0, whatever else is missing.
  parser.add_flag_callback("--describe", [&parser] { throw CLI::CallForVersion(Describe(parser), 0); })
      ->group("");
}

}  // namespace tutti::cli
