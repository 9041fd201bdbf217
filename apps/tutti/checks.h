// Checks of option values.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

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

}  // namespace tutti::cli
