// What the readers of text files share.
#pragma once

#include <algorithm>
#include <cctype>
#include <string>

#include "tutti/core/text.h"

namespace tutti::internal {

/// The beginning of a word that may be as long as a file, for a message.
inline std::string Excerpt(const std::string& word) {
  constexpr std::size_t kMost = 40;
  return word.size() <= kMost ? word : word.substr(0, kMost) + "...";
}

/// The first word such as "0,25" of a line whose columns are separated by blanks; empty if there is none.
inline std::string DecimalComma(const std::string& line) {
  if (line.find(',') == std::string::npos) return {};  // nearly all lines
  const std::vector<std::string> words = SplitText(line, " \t\r;");
  if (words.size() < 2) return {};
  const auto digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  for (const std::string& word : words) {
    const std::size_t comma = word.find(',');
    if (comma == std::string::npos) continue;
    const bool between =
        comma > 0 && comma + 1 < word.size() && digit(word[comma - 1]) && digit(word[comma + 1]);
    if (between && std::count(word.begin(), word.end(), ',') == 1) return word;
    return {};
  }
  return {};
}

}  // namespace tutti::internal
