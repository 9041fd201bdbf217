#include "apps/tutti/text_table.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <string_view>

#include "apps/tutti/options.h"
#include "core/terminal.h"

namespace tutti::cli {
namespace {

constexpr std::string_view kPlusMinus = " +- ";

std::string Escaped(const std::string& text, TableFormat format) {
  const bool latex = format == TableFormat::kLatex;
  std::string out;
  for (const char c : text) {
    const auto in = [c](std::string_view characters) { return characters.find(c) != std::string_view::npos; };
    if (latex && c == '\\') {
      out += "\\textbackslash{}";
    } else if (latex && in("~^")) {
      out += std::string("\\") + c + "{}";
    } else if (latex && in("<>")) {
      out += std::string("$") + c + "$";
    } else {
      if (latex ? in("_%&#${}") : format == TableFormat::kMarkdown && c == '|') out += '\\';
      out += c;
    }
  }
  return out;
}

/// "a +- b" with the sign of mathematics, for LaTeX.
std::string WithPlusMinus(std::string text) {
  const std::string math = " $\\pm$ ";
  for (std::size_t at = text.find(kPlusMinus); at != std::string::npos;
       at = text.find(kPlusMinus, at + math.size()))
    text.replace(at, kPlusMinus.size(), math);
  return text;
}

/// Characters, not bytes: labels hold UTF-8.
std::size_t Width(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

std::string MarkdownRule(const std::vector<std::size_t>& widths) {
  std::string line = "|";
  for (std::size_t k = 0; k < widths.size(); ++k)
    line += std::string(widths[k] + 1, '-') + (k == 0 ? "-|" : ":|");
  return line + "\n";
}

std::string CsvCell(const std::string& text) {
  if (text == "-") return {};
  return text.find_first_of(",\"\n") == std::string::npos ? text : Quoted(text);
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
      const std::string half = at == std::string::npos ? "-" : cells[k].substr(at + kPlusMinus.size());
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

void AddTableFormatOption(CLI::App& command, TableFormat& format) {
  const EnumWords<TableFormat> words = {{"text", TableFormat::kText},
                                        {"markdown", TableFormat::kMarkdown},
                                        {"latex", TableFormat::kLatex},
                                        {"csv", TableFormat::kCsv}};
  AddWord(command, "--table-format", format,
          "How tables are printed; latex needs the package booktabs, csv is for other programs", words,
          CLI::IsMember({"text", "markdown", "latex", "csv"}))
      ->default_str("text");
}

std::string Render(const TextTable& table, TableFormat format) {
  if (format == TableFormat::kCsv) return RenderCsv(table);
  const bool latex = format == TableFormat::kLatex, markdown = format == TableFormat::kMarkdown;
  std::vector<std::vector<std::string>> lines = {table.header};
  lines.insert(lines.end(), table.rows.begin(), table.rows.end());
  for (std::vector<std::string>& line : lines) {
    for (std::string& cell : line) {
      cell = Escaped(internal::Printable(cell), format);
      if (latex) cell = WithPlusMinus(cell);
    }
  }
  for (const auto& [row, column] : table.bold) {
    std::string& cell = lines.at(row + 1).at(column);
    cell = Bold(cell, format);
  }
  std::vector<std::size_t> widths(table.header.size(), markdown ? 3 : 0);
  for (const std::vector<std::string>& line : lines) {
    for (std::size_t k = 0; k < line.size(); ++k) widths.at(k) = std::max(widths[k], Width(line[k]));
  }
  const std::string begin = latex ? "" : markdown ? "| " : "  ";
  const std::string between = latex ? " & " : markdown ? " | " : "  ";
  const std::string end = latex ? " \\\\\n" : markdown ? " |\n" : "\n";
  std::string out;
  if (latex) out = "\\begin{tabular}{l" + std::string(widths.size() - 1, 'r') + "}\n\\toprule\n";
  for (std::size_t row = 0; row < lines.size(); ++row) {
    for (std::size_t k = 0; k < lines[row].size(); ++k) {
      const std::string& cell = lines[row][k];
      const std::string space(widths[k] - Width(cell), ' ');
      out += k == 0 ? begin + cell + space : between + space + cell;
    }
    out += end;
    if (row == 0 && latex) out += "\\midrule\n";
    if (row == 0 && markdown) out += MarkdownRule(widths);
  }
  if (latex) out += "\\bottomrule\n\\end{tabular}\n";
  return out;
}

std::string Formatted(const char* format, ...) {
  std::va_list arguments, again;
  va_start(arguments, format);
  va_copy(again, arguments);
  std::string text(static_cast<std::size_t>(std::max(0, std::vsnprintf(nullptr, 0, format, arguments))), ' ');
  std::vsnprintf(text.data(), text.size() + 1, format, again);
  va_end(again);
  va_end(arguments);
  return text;
}

std::string Fixed(double value, int decimals) {
  return std::isfinite(value) ? Formatted("%.*f", decimals, value) : "-";
}

std::string Quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

}  // namespace tutti::cli
