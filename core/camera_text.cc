#include "core/camera_text.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::internal {

PinholeCamera ParseCamera(const std::string& text, const std::string& option) {
  const std::string remedy = std::string("; write ") + kCameraText + " in pixels";
  const auto no_number = [&](const std::string& part) {
    throw InputError(option + ": '" + part + "' is no number" + remedy);
  };
  std::vector<double> values;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    const std::string part = text.substr(at, comma - at);
    const std::vector<std::string> words = SplitText(part, " \t");
    const std::optional<double> value = words.size() == 1 ? ParseDouble(words[0]) : std::nullopt;
    if (!value || !std::isfinite(*value)) no_number(part);
    values.push_back(*value);
    at = comma + 1;
  }
  if (values.size() != 4 && values.size() != 8 && values.size() != 9)
    throw InputError(option + ": has " + std::to_string(values.size()) + " numbers" + remedy);
  if (!(values[0] > 0) || !(values[1] > 0))
    throw InputError(option + " " + text + ": fx and fy must be above 0" + remedy);
  PinholeCamera camera;
  camera.fx = values[0];
  camera.fy = values[1];
  camera.cx = values[2];
  camera.cy = values[3];
  for (std::size_t i = 4; i < values.size(); ++i) {
    camera.coefficients[i - 4] = values[i];
    if (values[i] != 0) camera.distortion = Distortion::kRadTan;
  }
  return camera;
}

int PixelsOf(double value) {
  constexpr double kMost = 1e6;
  return value >= 0 && value <= kMost ? static_cast<int>(value) : -1;
}

}  // namespace tutti::internal
