// Checks of option values.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace tutti::cli {

/// Above 0. CLI11's own check prints the largest double, 309 digits long.
inline CLI::Validator Positive() {
  return CLI::Validator(
      [](std::string& text) {
        double value = 0;
        return CLI::detail::lexical_cast(text, value) && value > 0 ? std::string()
                                                                   : "'" + text + "' is not a number above 0";
      },
      "POSITIVE");
}

/// 0 or more.
inline CLI::Validator NotNegative() {
  return CLI::Validator(
      [](std::string& text) {
        double value = 0;
        return CLI::detail::lexical_cast(text, value) && value >= 0
                   ? std::string()
                   : "'" + text + "' is not a number of 0 or more";
      },
      "NOT NEGATIVE");
}

}  // namespace tutti::cli
