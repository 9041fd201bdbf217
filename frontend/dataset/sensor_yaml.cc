#include "frontend/dataset/sensor_yaml.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "core/camera_text.h"
#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

struct Value {
  TextLine text;  // line of the key; words of the value, brackets dropped
};
using Values = std::map<std::string, Value>;

// "key: word" and "key: [a, b, ...]" over any number of lines. Nested keys (T_BS: data:) count by their own
// name: no two of those that are used are equal.
Values ReadValues(const std::filesystem::path& file) {
  Values values;
  Value* open = nullptr;  // a list whose bracket is not closed yet
  for (TextLine line : ReadTextLines(file)) {
    std::size_t first = 0;
    if (open == nullptr) {
      std::string key = line.words[0];
      if (key.size() < 2 || key.back() != ':') continue;  // %YAML:1.0, ---
      key.pop_back();
      open = &values[key];
      open->text.number = line.number;
      first = 1;
    }
    bool more = false;
    for (std::size_t i = first; i < line.words.size(); ++i) {
      std::string word = line.words[i];
      if (word.find('[') != std::string::npos) more = true;
      if (word.find(']') != std::string::npos) more = false;
      word.erase(std::remove_if(word.begin(), word.end(), [](char c) { return c == '[' || c == ']'; }),
                 word.end());
      if (!word.empty()) open->text.words.push_back(word);
    }
    const bool closed = line.words.back().find(']') != std::string::npos;
    if (!more && (first == 1 || closed)) open = nullptr;
  }
  return values;
}

const TextLine& Get(const std::filesystem::path& file, const Values& values, const std::string& key,
                    std::size_t size) {
  const auto found = values.find(key);
  if (found == values.end()) throw InputError(file.string() + ": has no key '" + key + "'");
  const TextLine& text = found->second.text;
  if (text.words.size() != size) {
    throw InputError(At(file, text.number) + "'" + key + "' has " + std::to_string(text.words.size()) +
                     " values; " + std::to_string(size) + " are needed");
  }
  return text;
}

Pose ReadTransform(const std::filesystem::path& file, const TextLine& transform) {
  Eigen::Matrix<double, 3, 4> matrix;
  for (std::size_t i = 0; i < 12; ++i) {
    matrix(static_cast<int>(i) / 4, static_cast<int>(i) % 4) = NumberAt(file, transform, i);
  }
  if (!(std::abs(matrix.leftCols<3>().determinant() - 1.0) <= 0.01)) {  // also if it is not finite
    throw InputError(At(file, transform.number) +
                     "T_BS is not a rigid transform (its rotation has a determinant other than 1)");
  }
  return Pose::FromMatrix(matrix);
}

void CheckModel(const std::filesystem::path& file, const Values& values) {
  if (values.count("camera_model") == 0) return;
  const TextLine& model = Get(file, values, "camera_model", 1);
  if (model.words[0] != "pinhole")
    throw InputError(At(file, model.number) + "camera_model '" + model.words[0] +
                     "': tutti has pinhole alone");
}

}  // namespace

SensorYaml ReadSensorYaml(const std::filesystem::path& file) {
  const Values values = ReadValues(file);
  SensorYaml out;
  if (values.count("data") != 0) out.T_body_sensor = ReadTransform(file, Get(file, values, "data", 16));
  CheckModel(file, values);

  const TextLine& intrinsics = Get(file, values, "intrinsics", 4);
  PinholeCamera& c = out.camera;
  c.fx = NumberAt(file, intrinsics, 0);
  c.fy = NumberAt(file, intrinsics, 1);
  c.cx = NumberAt(file, intrinsics, 2);
  c.cy = NumberAt(file, intrinsics, 3);
  const TextLine& size = Get(file, values, "resolution", 2);
  c.width = internal::PixelsOf(NumberAt(file, size, 0));
  c.height = internal::PixelsOf(NumberAt(file, size, 1));

  const TextLine& model = Get(file, values, "distortion_model", 1);
  std::vector<double> lens;
  if (const auto found = values.find("distortion_coefficients"); found != values.end()) {
    const TextLine& text = found->second.text;
    for (std::size_t i = 0; i < text.words.size(); ++i) lens.push_back(NumberAt(file, text, i));
  } else if (model.words[0] != "none") {
    Get(file, values, "distortion_coefficients", 4);
  }
  const std::string wrong = internal::SetLens(model.words[0], lens, c);
  if (!wrong.empty()) throw InputError(At(file, model.number) + wrong);
  if (values.count("rate_hz") != 0) out.rate_hz = NumberAt(file, Get(file, values, "rate_hz", 1), 0);
  const std::string problem = c.Validate();
  if (!problem.empty()) throw InputError(file.string() + ": " + problem);
  return out;
}

}  // namespace tutti
