// How commands add options: checks of values, defaults in the help, words of enumerations.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <optional>
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

template <class Value>
CLI::Option* AddOption(CLI::App& command, const std::string& names, Value& value, const std::string& text,
                       const CLI::Validator& check) {
  return command.add_option(names, value, text)->check(check);
}

/// The help shows the value that holds without the option.
template <class Value>
CLI::Option* AddDefaulted(CLI::App& command, const std::string& names, Value& value, const std::string& text,
                          const CLI::Validator& check = CLI::Validator()) {
  return command.add_option(names, value, text)->check(check)->capture_default_str();
}

/// One of the words of an enumeration. `value`: the enumeration, or a std::optional of it.
template <class Value, class Enum>
CLI::Option* AddWord(CLI::App& command, const std::string& names, Value& value, const std::string& text,
                     const EnumWords<Enum>& words, const CLI::Validator& check) {
  const auto set = [&value, words](const std::string& given) {
    for (const auto& [word, meaning] : words) {
      if (given == word) value = meaning;
    }
  };
  return command.add_option_function<std::string>(names, set, text)->check(check);
}
template <class Value, class Enum>
CLI::Option* AddWord(CLI::App& command, const std::string& names, Value& value, const std::string& text,
                     const EnumWords<Enum>& words) {
  std::vector<std::string> known;
  for (const auto& [word, meaning] : words) known.emplace_back(word);
  return AddWord(command, names, value, text, words, OneOf(known));
}

/// An empty path is none.
inline CLI::Option* AddPath(CLI::App& command, const std::string& names,
                            std::optional<std::filesystem::path>& path, const std::string& text) {
  const auto set = [&path](const std::string& given) {
    if (!given.empty()) path = given;
  };
  return command.add_option_function<std::string>(names, set, text);
}

/// Has all options of the command that take a number refuse what can't be computed with: infinities, not a
/// number, magnitudes beyond 1e15 or (but for 0) below 1e-15, whole numbers beyond 64 bits, which the library
/// would cut off without a word, and more than 1024 threads.
void RefuseAbsurdNumbers(CLI::App& command);

}  // namespace tutti::cli
