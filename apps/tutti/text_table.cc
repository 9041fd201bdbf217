#include "apps/tutti/text_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

std::string EscapedForLatex(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '\\':
        out += "\\textbackslash{}";
        break;
      case '~':
      case '^':
        out += std::string("\\") + c + "{}";
        break;
      case '_':
      case '%':
      case '&':
      case '#':
      case '$':
      case '{':
      case '}':
        out += std::string("\\") + c;
        break;
      case '<':
      case '>':
        out += std::string("$") + c + "$";
        break;
      default:
        out += c;
    }
  }
  return out;
}

/// "a +- b" with the sign of mathematics, for LaTeX.
std::string WithPlusMinus(std::string text) {
  const std::string plain = " +- ", math = " $\\pm$ ";
  for (std::size_t at = text.find(plain); at != std::string::npos; at = text.find(plain, at + math.size()))
    text.replace(at, plain.size(), math);
  return text;
}

std::string EscapedForMarkdown(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '|' ? std::string("\\|") : std::string(1, c);
  return out;
}

/// Characters, not bytes: labels hold UTF-8.
std::size_t Width(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

std::string Padded(const std::string& text, std::size_t width, bool left) {
  const std::string space(width - std::min(width, Width(text)), ' ');
  return left ? text + space : space + text;
}

std::string Line(const std::vector<std::string>& cells, const std::vector<std::size_t>& widths,
                 const char* begin, const char* between, const char* end) {
  std::string line = begin;
  for (std::size_t k = 0; k < cells.size(); ++k)
    line += (k > 0 ? between : "") + Padded(cells[k], widths[k], k == 0);
  return line + end + "\n";
}

std::string MarkdownRule(const std::vector<std::size_t>& widths) {
  std::string line = "|";
  for (std::size_t k = 0; k < widths.size(); ++k) {
    const std::string dashes(std::max<std::size_t>(widths[k], 3) + 1, '-');
    line += k == 0 ? dashes + "-|" : dashes + ":|";
  }
  return line + "\n";
}

}  // namespace

void AddTableFormatOption(CLI::App& command, std::string& name) {
  command.add_option("--table-format", name, "How tables are printed; latex needs the package booktabs")
      ->check(CLI::IsMember({"text", "markdown", "latex"}))
      ->capture_default_str();
}

TableFormat ParseTableFormat(const std::string& name) {
  if (name == "text") return TableFormat::kText;
  if (name == "markdown") return TableFormat::kMarkdown;
  if (name == "latex") return TableFormat::kLatex;
  throw InputError("unknown table format '" + name + "'; use text, markdown or latex");
}

std::string Render(const TextTable& table, TableFormat format) {
  std::vector<std::vector<std::string>> lines = {table.header};
  lines.insert(lines.end(), table.rows.begin(), table.rows.end());
  std::vector<std::size_t> widths(table.header.size(), 0);
  for (std::vector<std::string>& line : lines) {
    for (std::size_t k = 0; k < line.size(); ++k) {
      if (format == TableFormat::kLatex) line[k] = WithPlusMinus(EscapedForLatex(line[k]));
      if (format == TableFormat::kMarkdown) line[k] = EscapedForMarkdown(line[k]);
      widths.at(k) = std::max(widths[k], Width(line[k]));
    }
  }
  if (format == TableFormat::kMarkdown) {
    for (std::size_t& width : widths) width = std::max<std::size_t>(width, 3);
  }
  std::string out;
  if (format == TableFormat::kLatex)
    out += "\\begin{tabular}{l" + std::string(widths.size() - 1, 'r') + "}\n\\toprule\n";
  for (std::size_t k = 0; k < lines.size(); ++k) {
    switch (format) {
      case TableFormat::kText:
        out += Line(lines[k], widths, "  ", "  ", "");
        break;
      case TableFormat::kMarkdown:
        out += Line(lines[k], widths, "| ", " | ", " |");
        if (k == 0) out += MarkdownRule(widths);
        break;
      case TableFormat::kLatex:
        out += Line(lines[k], widths, "", " & ", " \\\\");
        if (k == 0) out += "\\midrule\n";
        break;
    }
  }
  if (format == TableFormat::kLatex) out += "\\bottomrule\n\\end{tabular}\n";
  return out;
}

std::string Fixed(double value, int decimals) {
  if (!std::isfinite(value)) return "-";
  char text[80];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

}  // namespace tutti::cli
