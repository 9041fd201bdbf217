#include "apps/tutti/published.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <sstream>

#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::assets {
std::string PublishedTable();
}  // namespace tutti::assets

namespace tutti::cli {
namespace {

constexpr std::size_t kColumns = 7;

std::vector<std::string> Distinct(std::vector<std::string> words) {
  std::vector<std::string> out;
  for (std::string& word : words) {
    if (std::find(out.begin(), out.end(), word) == out.end()) out.push_back(std::move(word));
  }
  return out;
}

[[noreturn]] void Refuse(const std::string& where, const std::string& entry, const char* why) {
  throw InputError(where + "'" + entry + "' " + why);
}

PublishedRow ParseRow(const std::string& line, const std::string& where) {
  const std::vector<std::string> cells = SplitText(line, "\t");
  if (cells.size() != kColumns)
    throw InputError(where + std::to_string(cells.size()) + " columns instead of " +
                     std::to_string(kColumns));
  PublishedRow row{cells[0], cells[1], cells[2], cells[3], cells[4], cells[5], {}};
  if (row.alignment != "se3" && row.alignment != "sim3")
    throw InputError(where + "the alignment '" + row.alignment + "' is neither se3 nor sim3");
  for (const std::string& entry : SplitText(cells[6], " ")) {
    const std::size_t equals = entry.find('=');
    const std::string name = entry.substr(0, equals);
    const std::string figure = equals == std::string::npos ? "" : entry.substr(equals + 1);
    const std::optional<double> value = ParseDouble(figure);
    if (name.empty() || (figure != "x" && !(value && *value > 0)))
      Refuse(where, entry, "is no SEQUENCE=METRES");
    if (row.Of(name) != nullptr) Refuse(where, entry, "is a second figure of that sequence");
    row.ate_m.emplace_back(name, value);
  }
  return row;
}

/// Lower case; letters, digits, and single underscores for all else; "freiburg" is "fr".
std::string Plain(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const auto letter = static_cast<unsigned char>(c);
    if (std::isalnum(letter) != 0) {
      out += static_cast<char>(std::tolower(letter));
    } else if (!out.empty() && out.back() != '_') {
      out += '_';
    }
  }
  const std::size_t town = out.find("freiburg");
  return town == std::string::npos ? out : out.replace(town, 8, "fr");
}

std::string WithoutUnderscores(std::string text) {
  text.erase(std::remove(text.begin(), text.end(), '_'), text.end());
  return text;
}

/// KITTI's two digits are a word of their own; others' names are found with or without underscores (MH_01),
/// or by their words in this order (freiburg3_long_office).
bool Names(const std::string& part, const std::string& sequence) {
  const std::vector<std::string> words = SplitText(part, "_");
  const std::string name = Plain(sequence);
  if (std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isdigit(c) != 0; }))
    return std::find(words.begin(), words.end(), name) != words.end();
  if (name.find('_') == std::string::npos) return WithoutUnderscores(part).find(name) != std::string::npos;
  auto at = words.begin();
  for (const std::string& word : SplitText(name, "_")) {
    at = std::find(at, words.end(), word);
    if (at == words.end()) return false;
    ++at;
  }
  return true;
}

}  // namespace

const std::optional<double>* PublishedRow::Of(const std::string& sequence) const {
  for (const auto& [name, value] : ate_m) {
    if (name == sequence) return &value;
  }
  return nullptr;
}

std::vector<PublishedRow> ParsePublished(const std::string& text) {
  std::vector<PublishedRow> rows;
  std::istringstream in(text);
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    rows.push_back(ParseRow(line, "published.tsv:" + std::to_string(number) + ": "));
  }
  return rows;
}

const std::vector<PublishedRow>& PublishedRows() {
  static const std::vector<PublishedRow> rows = ParsePublished(assets::PublishedTable());
  return rows;
}

std::vector<std::string> PublishedBenchmarks() {
  std::vector<std::string> names;
  for (const PublishedRow& row : PublishedRows()) names.push_back(row.benchmark);
  return Distinct(std::move(names));
}

std::vector<std::string> PublishedSequences(const std::string& benchmark) {
  std::vector<std::string> names;
  for (const PublishedRow& row : PublishedRows()) {
    if (row.benchmark != benchmark) continue;
    for (const auto& [name, value] : row.ate_m) names.push_back(name);
  }
  return Distinct(std::move(names));
}

std::string SequenceInPath(const std::string& benchmark, const std::string& path) {
  std::vector<std::string> parts;
  for (const std::filesystem::path& part : std::filesystem::path(path)) parts.push_back(Plain(part.string()));
  const std::vector<std::string> sequences = PublishedSequences(benchmark);
  for (auto part = parts.rbegin(); part != parts.rend(); ++part) {
    for (const std::string& sequence : sequences) {
      if (Names(*part, sequence)) return sequence;
    }
  }
  return {};
}

}  // namespace tutti::cli
