// Small text helpers that more than one module needs: lists of words, strict number parsing, natural order,
// nearest word.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#pragma GCC visibility push(default)
namespace tutti {

/// Splits at any of the separators, empty pieces dropped.
std::vector<std::string> SplitText(std::string_view text, std::string_view separators = " \t\r,");

/// The words with `between` in between; before the first word that is not empty there is none.
std::string JoinText(const std::vector<std::string>& words, std::string_view between = ", ");

/// The whole text as a number in the C locale ("1e-3", "nan", "inf" too); nothing if it is not one.
std::optional<double> ParseDouble(std::string_view text);
std::optional<long long> ParseInteger(std::string_view text);

/// Natural order: runs of digits compare as numbers, so that 2.jpg comes before 10.jpg. Total and
/// deterministic.
bool NaturalLess(const std::string& a, const std::string& b);

/// The candidate with the smallest edit distance to `word`; empty if there are none.
std::string NearestWord(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace tutti
#pragma GCC visibility pop
