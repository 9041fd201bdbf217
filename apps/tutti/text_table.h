// Tables for the terminal, for Markdown and for LaTeX, and texts with numbers.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace CLI {
class App;
}

namespace tutti::cli {

enum class TableFormat { kText, kMarkdown, kLatex, kCsv };
/// Adds --table-format to a command.
void AddTableFormatOption(CLI::App& command, TableFormat& format);

/// A table of texts; every row has as many cells as the header. The first column is flush left, the others
/// flush right.
struct TextTable {
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
  std::vector<std::pair<std::size_t, std::size_t>>
      bold;  ///< (row, column); a star before it where text has no bold
};

/// The table, each line ended by a newline. LaTeX: a tabular for the package booktabs, special characters
/// escaped. CSV: a column of "a +- b" becomes two; nothing is bold, and "-" is an empty cell.
std::string Render(const TextTable& table, TableFormat format);

/// As printf makes it.
std::string Formatted(const char* format, ...) __attribute__((format(printf, 1, 2)));
/// The value with so many decimals; "-" if it is not finite.
std::string Fixed(double value, int decimals);
/// A cell of a CSV file that may hold anything.
std::string Quoted(const std::string& text);

}  // namespace tutti::cli
