#include "core/number_lines.h"

#include <cmath>
#include <optional>

#include "core/angle.h"
#include "core/text_input.h"
#include "core/text_reader.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::internal {

void FailAt(const std::filesystem::path& file, std::size_t line, const std::string& what) {
  throw InputError(file.string() + ":" + std::to_string(line) + ": " + what);
}

bool IsComment(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  return first != std::string::npos && (text[first] == '#' || text[first] == '%');
}

void ForEachLine(const std::filesystem::path& file,
                 const std::function<void(std::size_t, const std::vector<std::string>&)>& use,
                 const TakesLine& names) {
  TextReader in(file);
  std::string text;
  while (in.Next(text)) {
    const std::size_t line = in.number();
    if (names(text)) continue;
    const std::size_t comment = text.find('#');
    if (comment != std::string::npos) text.resize(comment);
    const std::string comma = DecimalComma(text);
    if (!comma.empty())
      FailAt(file, line, "'" + Excerpt(comma) + "' has a decimal comma; write decimal points");
    const std::vector<std::string> words = SplitText(text, " \t\r,;");
    if (!words.empty()) use(line, words);
  }
}

double NumberAt(const std::filesystem::path& file, std::size_t line, const std::string& word) {
  const std::optional<double> value = ParseDouble(word);
  if (!value) FailAt(file, line, "'" + Excerpt(word) + "' is not a number");
  if (!std::isfinite(*value))
    FailAt(file, line, "'" + word + "' is not finite; remove this pose or repair the file");
  constexpr double kLargest = 1e100;  // squares of what is beyond it overflow
  if (std::abs(*value) > kLargest)
    FailAt(file, line,
           "'" + Excerpt(word) + "' is too large to compute with; remove this pose or repair the file");
  return *value;
}

MotionSigma SigmaAt(const std::filesystem::path& file, std::size_t line, const std::string& translation,
                    const std::string& rotation) {
  const double metres = NumberAt(file, line, translation), degrees = NumberAt(file, line, rotation);
  if (metres < 0 || degrees < 0) FailAt(file, line, "a standard deviation is below 0");
  return {metres, degrees * kRadians};
}

}  // namespace tutti::internal
