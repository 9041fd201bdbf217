#include "apps/tutti/text_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/terminal.h"
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

constexpr const char* kPlusMinus = " +- ";

std::string CsvCell(const std::string& text) {
  if (text == "-") return {};
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

std::string RenderCsv(const TextTable& table) {
  std::vector<bool> splits(table.header.size(), false);
  for (const std::vector<std::string>& row : table.rows) {
    for (std::size_t k = 0; k < row.size(); ++k)
      splits[k] = splits[k] || row[k].find(kPlusMinus) != std::string::npos;
  }
  const auto line = [&](const std::vector<std::string>& cells, bool is_header) {
    std::string out;
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const std::size_t at = is_header ? std::string::npos : cells[k].find(kPlusMinus);
      out += (k > 0 ? "," : "") + CsvCell(cells[k].substr(0, at));
      if (!splits[k]) continue;
      const std::string half =
          at == std::string::npos ? "-" : cells[k].substr(at + std::string(kPlusMinus).size());
      out += "," + CsvCell(is_header ? cells[k] + " +-" : half);
    }
    return out + "\n";
  };
  std::string out = line(table.header, true);
  for (const std::vector<std::string>& row : table.rows) out += line(row, false);
  return out;
}

std::string Bold(const std::string& cell, TableFormat format) {
  if (format == TableFormat::kMarkdown) return "**" + cell + "**";
  return format == TableFormat::kLatex ? "\\textbf{" + cell + "}" : "*" + cell;
}

}  // namespace

void AddTableFormatOption(CLI::App& command, std::string& name) {
  command
      .add_option("--table-format", name,
                  "How tables are printed; latex needs the package booktabs, csv is for other programs")
      ->check(CLI::IsMember({"text", "markdown", "latex", "csv"}))
      ->capture_default_str();
}

TableFormat ParseTableFormat(const std::string& name) {
  if (name == "text") return TableFormat::kText;
  if (name == "markdown") return TableFormat::kMarkdown;
  if (name == "latex") return TableFormat::kLatex;
  if (name == "csv") return TableFormat::kCsv;
  throw InputError("unknown table format '" + name + "'; use text, markdown, latex or csv");
}

std::string Render(const TextTable& table, TableFormat format) {
  if (format == TableFormat::kCsv) return RenderCsv(table);
  std::vector<std::vector<std::string>> lines = {table.header};
  lines.insert(lines.end(), table.rows.begin(), table.rows.end());
  std::vector<std::size_t> widths(table.header.size(), 0);
  for (std::vector<std::string>& line : lines) {
    for (std::size_t k = 0; k < line.size(); ++k) {
      line[k] = internal::Printable(line[k]);
      if (format == TableFormat::kLatex) line[k] = WithPlusMinus(EscapedForLatex(line[k]));
      if (format == TableFormat::kMarkdown) line[k] = EscapedForMarkdown(line[k]);
    }
  }
  for (const auto& [row, column] : table.bold) {
    std::string& cell = lines.at(row + 1).at(column);
    cell = Bold(cell, format);
  }
  for (const std::vector<std::string>& line : lines) {
    for (std::size_t k = 0; k < line.size(); ++k) widths.at(k) = std::max(widths[k], Width(line[k]));
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
      case TableFormat::kCsv:
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
