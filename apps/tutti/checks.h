// Checks of option values.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>
#include <vector>

#include "tutti/core/options.h"
#include "tutti/core/text.h"

namespace tutti::cli {

/// Numbers that `fits` takes; `name` stands in the help. CLI11's own checks print the largest double, 309
/// digits long.
inline CLI::Validator NumberThat(bool (*fits)(double), const std::string& is, const std::string& name) {
  return CLI::Validator(
      [fits, is](std::string& text) {
        double value = 0;
        const bool good = CLI::detail::lexical_cast(text, value) && fits(value);
        return good ? std::string() : "'" + text + "' is not a number " + is;
      },
      name);
}

inline CLI::Validator Positive() {
  return NumberThat([](double value) { return value > 0; }, "above 0", "POSITIVE");
}
inline CLI::Validator NotNegative() {
  return NumberThat([](double value) { return value >= 0; }, "of 0 or more", "NOT NEGATIVE");
}

/// One of these words; another one is answered with the nearest. The help shows {one,two}.
inline CLI::Validator OneOf(const std::vector<std::string>& words) {
  return CLI::Validator(
      [words](std::string& text) {
        if (std::find(words.begin(), words.end(), text) != words.end()) return std::string();
        return "'" + text + "' is unknown; did you mean '" + NearestWord(text, words) +
               "'? There are: " + JoinText(words);
      },
      "{" + JoinText(words, ",") + "}");
}

/// The words of an enumeration's values.
template <class Enum>
CLI::Validator OneOf(Enum any) {
  std::vector<std::string> words;
  for (const auto& [word, value] : WordsOf(any)) words.emplace_back(word);
  return OneOf(words);
}

}  // namespace tutti::cli
