#include "apps/tutti/help.h"

#include <algorithm>
#include <utility>

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

}  // namespace tutti::cli
