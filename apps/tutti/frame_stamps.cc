#include "apps/tutti/frame_stamps.h"

#include <cmath>
#include <optional>
#include <string>

#include "core/text_input.h"
#include "core/text_reader.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::cli {

std::vector<double> ReadFrameStamps(const std::filesystem::path& file) {
  constexpr double kNanoseconds = 1e14;  // no clock says so many seconds
  internal::TextReader in(file, "give the list of images with their time stamps");
  std::vector<double> out;
  std::string line;
  while (in.Next(line)) {
    const std::vector<std::string> words = SplitText(line);
    if (words.empty() || words[0][0] == '#') continue;
    const std::string where = file.string() + ":" + std::to_string(in.number()) + ": ";
    const std::optional<double> value = ParseDouble(words[0]);
    if (!value || !std::isfinite(*value))
      throw InputError(where + "'" + internal::Excerpt(words[0]) +
                       "' is no time stamp; each line begins with one");
    const double stamp = *value > kNanoseconds ? 1e-9 * *value : *value;
    if (!out.empty() && stamp < out.back()) throw InputError(where + "the stamps go back in time");
    out.push_back(stamp);
  }
  if (out.empty()) throw InputError(file.string() + ": holds no time stamp");
  return out;
}

}  // namespace tutti::cli
