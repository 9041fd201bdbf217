// Calibrations as tables of words and numbers, not keys: COLMAP, DSO, ETH3D and others.
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <map>
#include <sstream>
#include <vector>

#include "apps/run/calibration_keys.h"
#include "core/camera_text.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

struct TableLine {
  std::size_t number = 0;
  std::vector<std::string> words;
};

class CalibrationTable {
 public:
  CalibrationTable(const fs::path& file, const std::string& text) : file_(file) {
    std::istringstream in(text);
    std::size_t number = 0;
    for (std::string line; std::getline(in, line);) {
      ++number;
      const std::vector<std::string> words = SplitText(line.substr(0, line.find('#')));
      if (!words.empty()) lines.push_back({number, words});
    }
  }

  [[noreturn]] void Fail(const TableLine& line, const std::string& what) const {
    throw InputError(file_.string() + ":" + std::to_string(line.number) + ": " + what);
  }
  // All words of a line from `first` on, as numbers.
  std::vector<double> Numbers(const TableLine& line, std::size_t first = 0) const {
    std::vector<double> values;
    for (std::size_t i = first; i < line.words.size(); ++i) {
      const std::optional<double> value = ParseDouble(line.words[i]);
      if (!value || !std::isfinite(*value)) Fail(line, "'" + line.words[i] + "' is no number");
      values.push_back(*value);
    }
    return values;
  }
  void Set(const TableLine& line, const std::string& lens, const std::vector<double>& coefficients,
           PinholeCamera& camera) const {
    const std::string wrong = internal::SetLens(lens, coefficients, camera);
    if (!wrong.empty()) Fail(line, wrong);
  }

  std::vector<TableLine> lines;

 private:
  fs::path file_;
};

bool ReadsAsNumber(const std::string& word) { return ParseDouble(word).has_value(); }

// COLMAP's models by its own names (src/colmap/sensor/models.h). Terms in the order of the parameters; what
// they are called in OpenCV's order.
struct ColmapModel {
  std::vector<const char*> parameters;
  const char* lens;
};
const std::map<std::string, ColmapModel> kColmap = {
    {"SIMPLE_PINHOLE", {{"f", "cx", "cy"}, "none"}},
    {"PINHOLE", {{"fx", "fy", "cx", "cy"}, "none"}},
    {"SIMPLE_RADIAL", {{"f", "cx", "cy", "k1"}, "radtan"}},
    {"RADIAL", {{"f", "cx", "cy", "k1", "k2"}, "radtan"}},
    {"OPENCV", {{"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"}, "radtan"}},
    {"FULL_OPENCV",
     {{"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}, "FULL_OPENCV"}},
    {"SIMPLE_RADIAL_FISHEYE", {{"f", "cx", "cy", "k1"}, "fisheye"}},
    {"RADIAL_FISHEYE", {{"f", "cx", "cy", "k1", "k2"}, "fisheye"}},
    {"OPENCV_FISHEYE", {{"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"}, "fisheye"}},
    {"SIMPLE_FISHEYE", {{"f", "cx", "cy"}, "fisheye"}},
    {"FISHEYE", {{"fx", "fy", "cx", "cy"}, "fisheye"}}};

bool IsColmap(const CalibrationTable& table) {
  const std::vector<std::string>& words = table.lines.front().words;
  return words.size() > 4 && ReadsAsNumber(words[0]) &&
         std::isalpha(static_cast<unsigned char>(words[1][0])) != 0 && ReadsAsNumber(words[2]) &&
         ReadsAsNumber(words[3]);
}

Calibration FromColmap(const CalibrationTable& table) {
  const TableLine& line = table.lines.front();
  const auto model = kColmap.find(line.words[1]);
  Calibration out;
  out.format = "COLMAP";
  if (table.lines.size() > 1)
    out.format += ", camera " + line.words[0] + ", the first of " + std::to_string(table.lines.size());
  if (model == kColmap.end()) {
    table.Set(line, line.words[1], {}, out.camera);
    table.Fail(line, "the model '" + line.words[1] + "' is none of COLMAP's that tutti knows");
  }
  const std::vector<double> size = table.Numbers({line.number, {line.words[2], line.words[3]}});
  const std::vector<double> values = table.Numbers(line, 4);
  if (values.size() != model->second.parameters.size())
    table.Fail(line, line.words[1] + " has " + std::to_string(values.size()) + " parameters; " +
                         std::to_string(model->second.parameters.size()) + " are needed");
  std::map<std::string, double> named;
  for (std::size_t i = 0; i < values.size(); ++i) named[model->second.parameters[i]] = values[i];
  const bool one = named.count("f") != 0;
  // COLMAP's (0, 0) is the corner of the first pixel, not its centre.
  out.camera =
      Intrinsics(named[one ? "f" : "fx"], named[one ? "f" : "fy"], named["cx"] - 0.5, named["cy"] - 0.5);
  SetPixels(size[0], size[1], out.camera);
  const std::string lens = model->second.lens;
  const bool fisheye = lens == "fisheye";
  std::vector<double> terms;
  for (const char* name : {"k1", "k2", fisheye ? "k3" : "p1", fisheye ? "k4" : "p2"})
    terms.push_back(named[name]);
  if (!fisheye) {
    for (const char* name : {"k3", "k4", "k5", "k6"}) terms.push_back(named[name]);
  }
  table.Set(line, lens, terms, out.camera);
  return out;
}

// "Intrinsic of "Color" / 640x480 / {RGB8}", then a line for each value.
std::optional<Calibration> FromRealSense(const CalibrationTable& table) {
  constexpr std::array<const char*, 8> kNames = {
      "Width:", "Height:", "Fx:", "Fy:", "PPX:", "PPY:", "Distortion:", "Coeffs:"};
  std::map<std::string, TableLine> values;
  for (const TableLine& line : table.lines) {
    const std::string& key = line.words[0];
    if (std::find(kNames.begin(), kNames.end(), key) == kNames.end()) continue;
    const auto [at, added] = values.emplace(key, line);
    if (!added && at->second.words != line.words)
      table.Fail(line, "a second stream begins; keep the lines of yours alone, from Width: to Coeffs:");
  }
  if (values.count("PPX:") == 0) return std::nullopt;
  const auto number = [&](const char* key) {
    const auto found = values.find(key);
    if (found == values.end()) table.Fail(table.lines.front(), std::string("has no line '") + key + "'");
    const std::vector<double> read = table.Numbers(found->second, 1);
    if (read.size() != 1) table.Fail(found->second, std::string("'") + key + "' needs one number");
    return read[0];
  };
  Calibration out;
  out.format = "RealSense";
  std::array<double, 6> v{};
  std::transform(kNames.begin(), kNames.begin() + v.size(), v.begin(), number);
  out.camera = Intrinsics(v[2], v[3], v[4], v[5]);
  SetPixels(v[0], v[1], out.camera);
  if (const auto lens = values.find("Distortion:"); lens != values.end()) {
    const std::vector<std::string>& words = lens->second.words;
    const auto terms = values.find("Coeffs:");
    table.Set(lens->second, JoinText({words.begin() + 1, words.end()}, " "),
              terms == values.end() ? std::vector<double>() : table.Numbers(terms->second, 1), out.camera);
  }
  return out;
}

// The first line may name the model; the second has the size; fractions of it, where the focal length is
// below 10. Four terms and one more without a name are those of the FOV model.
bool IsDso(const CalibrationTable& table) {
  const std::vector<TableLine>& lines = table.lines;
  const std::vector<std::string>& first = lines.front().words;
  return lines.size() >= 2 && lines[1].words.size() == 2 && ReadsAsNumber(lines[1].words[0]) &&
         (first.size() == 5 || !ReadsAsNumber(first[0]));
}

Calibration FromDso(const CalibrationTable& table) {
  const TableLine& line = table.lines.front();
  const bool named = !ReadsAsNumber(line.words[0]);
  const std::vector<double> v = table.Numbers(line, named ? 1 : 0), size = table.Numbers(table.lines[1]);
  if (v.size() != 5 && v.size() != 8)
    table.Fail(line, "has " + std::to_string(v.size()) + " numbers; 5 or 8 are needed");
  Calibration out;
  out.format = "DSO";
  constexpr double kLongestFraction = 10;
  out.camera = v[0] < kLongestFraction && v[1] < kLongestFraction
                   ? Intrinsics(v[0] * size[0], v[1] * size[1], v[2] * size[0] - 0.5, v[3] * size[1] - 0.5)
                   : Intrinsics(v[0], v[1], v[2], v[3]);
  SetPixels(size[0], size[1], out.camera);
  table.Set(line, named ? line.words[0] : "FOV", {v.begin() + 4, v.end()}, out.camera);
  return out;
}

// 3x3, 3x4 or 4x4 values, a row on each line or all on one.
bool IsMatrix(const CalibrationTable& table, const std::vector<double>& v) {
  const std::size_t lines = table.lines.size();
  if (v.size() == 9) return lines == 3 || (lines == 1 && v[1] == 0 && v[3] == 0 && v[6] == 0 && v[8] == 1);
  return v.size() == 12 || v.size() == 16;
}

Calibration FromNumbers(const CalibrationTable& table, const std::vector<double>& v) {
  const TableLine& line = table.lines.front();
  Calibration out;
  if (IsMatrix(table, v)) {
    out.format = "a camera matrix";
    const std::size_t columns = v.size() == 9 ? 3 : 4;
    if (v[1] != 0 || v[columns] != 0 || v[2 * columns] != 0 || v[2 * columns + 1] != 0 ||
        v[2 * columns + 2] != 1)
      table.Fail(line, "is no camera matrix that tutti has (fx 0 cx, 0 fy cy, 0 0 1)");
    out.camera = Intrinsics(v[0], v[columns + 1], v[2], v[columns + 2]);
    return out;
  }
  out.format = "fx fy cx cy";
  if (table.lines.size() > 1 || (v.size() != 4 && v.size() != 8 && v.size() != 9))
    table.Fail(line, "has " + std::to_string(v.size()) + " numbers; " + internal::kCameraText +
                         " on one line, or a camera matrix, are needed");
  out.camera = Intrinsics(v[0], v[1], v[2], v[3]);
  table.Set(line, "radtan", {v.begin() + 4, v.end()}, out.camera);
  if (v.size() > 4) out.format += " k1 k2 p1 p2";
  return out;
}

}  // namespace

std::optional<Calibration> ReadCalibrationTable(const fs::path& file, const std::string& text) {
  const CalibrationTable table(file, text);
  if (table.lines.empty()) return std::nullopt;
  if (IsColmap(table)) return FromColmap(table);
  if (IsDso(table)) return FromDso(table);
  constexpr std::size_t kMostNumbers = 16;
  std::vector<double> all;
  for (const TableLine& line : table.lines) {
    const bool numbers = std::all_of(line.words.begin(), line.words.end(), ReadsAsNumber);
    if (!numbers || all.size() > kMostNumbers) return FromRealSense(table);
    const std::vector<double> values = table.Numbers(line);
    all.insert(all.end(), values.begin(), values.end());
  }
  return FromNumbers(table, all);
}

}  // namespace tutti
