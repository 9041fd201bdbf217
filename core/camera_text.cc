#include "core/camera_text.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <utility>

#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::internal {
namespace {

enum class Lens { kNone, kRadTan, kRadial, kZero, kEquidistant, kOther, kUnknown };

// kRadial: radtan if p1 and p2 are 0 (librealsense's has them behind the radial part); kZero: a pinhole if
// all are 0; kOther: never a pinhole.
const std::pair<Lens, std::vector<const char*>> kLenses[] = {
    {Lens::kRadTan,
     {"", "radtan", "radialtangential", "plumbbob", "pinhole", "perspective", "opencv", "brown",
      "brownconrady", "rational", "rationalpolynomial", "radtan8", "pinholeradtan", "pinholeradtan8",
      "pinholefull", "fullopencv"}},
    {Lens::kNone, {"none", "rectified"}},
    {Lens::kRadial, {"modifiedbrownconrady"}},
    {Lens::kZero, {"inversebrownconrady", "radialdivision", "division", "fov"}},
    {Lens::kEquidistant,
     {"equidistant", "equi", "fisheye", "opencvfisheye", "kannalabrandt", "kannalabrandt4", "kannalabrandt8",
      "kb4", "kb8"}},
    {Lens::kOther,
     {"omni", "mei", "ucm", "eucm", "ds", "doublesphere", "equirectangular", "scaramuzza", "ftheta",
      "thinprismfisheye", "fisheye624", "fisheye62"}}};

// "RS2_DISTORTION_BROWN_CONRADY", "distortion.brown_conrady" -> "brownconrady".
Lens LensOf(const std::string& model) {
  std::string name;
  for (const char c : model) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  for (const std::string prefix : {"rs2", "distortion"}) {
    if (name.rfind(prefix, 0) == 0) name.erase(0, prefix.size());
  }
  for (const auto& [lens, names] : kLenses) {
    if (std::find(names.begin(), names.end(), name) != names.end()) return lens;
  }
  return Lens::kUnknown;
}

// Position of the first value from `first` on that is not 0; else their number.
std::size_t FirstUsed(const std::vector<double>& values, std::size_t first) {
  while (first < values.size() && values[first] == 0) ++first;
  return first;
}

}  // namespace

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

std::string SetLens(const std::string& model, const std::vector<double>& values, PinholeCamera& camera) {
  const Lens lens = LensOf(model);
  const std::string name = "the lens model" + (model.empty() ? "" : " '" + model + "'");
  const std::string remedy =
      "; these are radtan (k1 k2 p1 p2 k3) and equidistant (fisheye, k1 k2 k3 k4): calibrate the camera with "
      "one of them, or undistort the images";
  camera.distortion = Distortion::kNone;
  camera.coefficients = {};
  const bool zeros = FirstUsed(values, 0) == values.size();
  const bool needs_zeros = lens == Lens::kUnknown || lens == Lens::kZero;
  if (lens == Lens::kOther || (needs_zeros && (!zeros || values.empty())))
    return name + " is none that tutti has" + remedy;
  if (zeros && lens != Lens::kEquidistant) return {};  // an equidistant lens without terms is no pinhole
  if (lens == Lens::kNone) return name + " has coefficients that are not 0; name the lens, or leave them out";
  if (values.size() < 4)
    return name + " has " + std::to_string(values.size()) + " coefficients; 4 or 5 are needed";
  const std::size_t most = lens == Lens::kEquidistant ? 4 : 5;
  if (const std::size_t more = FirstUsed(values, most); more < values.size())
    return name + " has more than " + std::to_string(most) + " coefficients: number " +
           std::to_string(more + 1) + " is not 0" + remedy;
  if (lens == Lens::kRadial && (values[2] != 0 || values[3] != 0))
    return name + " with p1 and p2 is none that tutti has" + remedy;
  camera.distortion = lens == Lens::kEquidistant ? Distortion::kEquidistant : Distortion::kRadTan;
  std::copy_n(values.begin(), std::min(most, values.size()), camera.coefficients.begin());
  return {};
}

}  // namespace tutti::internal
