#include "apps/run/calibration_keys.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <sstream>
#include <utility>

#include "core/camera_text.h"
#include "core/text_reader.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

constexpr KeyNames kMatrix = {
    "camera_matrix", "Camera_Matrix", "cameraMatrix", "intrinsic_matrix", "cam_K", "K", "k"};
constexpr KeyNames kIntrinsics = {"intrinsics", "intrinsic"};
constexpr KeyNames kFx = {"fx", "fl_x", "mu"}, kFy = {"fy", "fl_y", "mv"};
constexpr KeyNames kCx = {"cx", "ppx", "u0"}, kCy = {"cy", "ppy", "v0"};
constexpr KeyNames kWidth = {"image_width", "image_Width", "width", "w", "W", "cols"};
constexpr KeyNames kHeight = {"image_height", "image_Height", "height", "h", "H", "rows"};
constexpr KeyNames kSize = {"resolution", "image_dimension", "cameraResolution"};
constexpr KeyNames kLens = {"distortion_coefficients",
                            "Distortion_Coefficients",
                            "distortion_coeffs",
                            "dist_coeffs",
                            "distCoeffs",
                            "dist_coeff",
                            "distortion",
                            "coeffs",
                            "D",
                            "d"};
constexpr KeyNames kLensModel = {"distortion_model", "distortion_type"};
constexpr KeyNames kCameraModel = {"camera_model", "model_type", "camera_type", "model", "type"};
constexpr KeyNames kAnyModel = {"distortion_model", "distortion_type", "camera_model", "model_type",
                                "camera_type",      "model",           "type"};
// Maps in which programs keep a part of a camera.
constexpr KeyNames kParts = {"projection_parameters", "distortion_parameters", "intrinsics", "distortion"};

// YAML's anchors can nest without end.
constexpr int kDeepest = 4;
constexpr std::size_t kMostValues = 64;

// What a matrix of OpenCV or ROS ({rows, cols, data}) or a lens of maplab ({type, parameters}) holds.
YAML::Node DataOf(const YAML::Node& node) {
  if (!node.IsMap()) return node;
  if (node["data"].IsDefined()) return node["data"];
  const YAML::Node inner = node["parameters"];
  return inner.IsDefined() && inner.IsMap() ? inner["data"] : inner;
}

bool IsNumberNode(const YAML::Node& node) {
  double value = 0;
  return node.IsScalar() && YAML::convert<double>::decode(node, value);
}

bool IsList(const KeyValue& value) {
  if (!value) return false;
  const YAML::Node data = DataOf(value.node);
  return data.IsDefined() && (data.IsSequence() || (data.IsScalar() && SplitText(data.Scalar()).size() >= 4));
}

bool IsFisheye(const std::string& lens) {
  PinholeCamera camera;
  return internal::SetLens(lens, {0, 0, 0, 0}, camera).empty() &&
         camera.distortion == Distortion::kEquidistant;
}

CalibrationKeys WithParts(const CalibrationKeys& keys) {
  CalibrationKeys out = keys;
  for (const char* name : kParts) {
    const KeyValue part = keys.Find({name});
    if (part && !IsList(part)) out = out.Or(part.node);
  }
  return out;
}

PinholeCamera IntrinsicsOf(const CalibrationKeys& keys) {
  KeyValue list = keys.Find(kMatrix);
  if (IsList(list)) return CameraOfMatrix(keys, list);
  list = keys.Find(kIntrinsics);
  if (IsList(list)) {
    const std::vector<double> v = keys.Numbers(list);
    if (v.size() == 9 || v.size() == 16) return CameraOfMatrix(keys, list);
    if (v.size() != 4) keys.FailSize(list, v.size(), "4 are needed: fx, fy, cx, cy");
    if (keys.Has("sensor_name") && list.node.IsMap()) return Intrinsics(v[0], v[2], v[1], v[3]);  // OpenLORIS
    return Intrinsics(v[0], v[1], v[2], v[3]);
  }
  if (keys.Has("focal_length") && keys.Has("principal_point")) {  // OKVIS
    const auto focal = keys.Array<2>(keys.Find({"focal_length"}));
    const auto centre = keys.Array<2>(keys.Find({"principal_point"}));
    return Intrinsics(focal[0], focal[1], centre[0], centre[1]);
  }
  return Intrinsics(keys.Needed(kFx), keys.Needed(kFy), keys.Needed(kCx), keys.Needed(kCy));
}

void SetSize(const CalibrationKeys& keys, PinholeCamera& camera) {
  if (const KeyValue size = keys.Find(kSize)) {
    const auto values = keys.Array<2>(size);
    return SetPixels(values[0], values[1], camera);
  }
  const std::optional<double> width = keys.Number(kWidth), height = keys.Number(kHeight);
  if (width.has_value() != height.has_value())
    keys.Fail(keys.map(),
              std::string("has an image ") + (width ? "width, but no height" : "height, but no width"));
  SetPixels(width.value_or(0), height.value_or(0), camera);
}

// k1, k2, ... under their own names, in the order of the lens.
std::vector<double> NamedTerms(const CalibrationKeys& keys, const std::string& lens) {
  const bool fisheye = IsFisheye(lens);
  std::vector<const char*> names = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  if (fisheye) names = {"k1", "k2", "k3", "k4"};
  if (fisheye && keys.Has("mu")) names = {"k2", "k3", "k4", "k5"};  // VINS counts from the term before
  std::vector<double> values;
  bool any = false;
  for (const char* name : names) {
    any = any || keys.Has(name);
    values.push_back(keys.Number({name}).value_or(0));
  }
  for (const char* name :
       {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "p3", "p4", "s1", "s2", "s3", "s4", "xi"}) {
    const auto used = std::find_if(names.begin(), names.end(),
                                   [&](const char* known) { return std::string(known) == name; });
    if (used == names.end() && keys.Number({name}).value_or(0) != 0)
      keys.Fail(
          keys.Find({name}).node,
          std::string("'") + name + "' is not 0, but the lens" + (lens.empty() ? "" : " '" + lens + "'") +
              " has no such coefficient; tutti has radtan (k1 k2 p1 p2 k3) and equidistant (k1 k2 k3 k4)");
  }
  return any ? values : std::vector<double>();
}

void SetLensOf(const CalibrationKeys& keys, const KeyValue& list, const std::string& lens,
               PinholeCamera& camera, std::string* note) {
  const bool listed = IsList(list) || (list && IsNumberNode(list.node));
  const std::vector<double> values = listed ? keys.Numbers(list) : NamedTerms(keys, lens);
  const std::string wrong = internal::SetLens(lens, values, camera);
  if (!wrong.empty()) keys.Fail(listed ? list.node : keys.map(), wrong);
  if (lens.empty() && listed && values.size() == 4 && camera.distortion == Distortion::kRadTan)
    *note = "radtan, as the file names no lens";
}

ImageWindow WindowOf(const CalibrationKeys& keys) {
  ImageWindow window;
  const auto pixels = [](const CalibrationKeys& in, const char* name) {
    return internal::PixelsOf(in.Number({name}).value_or(0));
  };
  window.binning_x = pixels(keys, "binning_x");
  window.binning_y = pixels(keys, "binning_y");
  const KeyValue roi = keys.Find({"roi"});
  if (!roi || !roi.node.IsMap()) return window;
  const CalibrationKeys region = keys.At(roi.node);
  window.x_offset = pixels(region, "x_offset");
  window.y_offset = pixels(region, "y_offset");
  window.width = pixels(region, "width");
  window.height = pixels(region, "height");
  return window;
}

void Flatten(const CalibrationKeys& keys, const YAML::Node& node, const std::string& key, int depth,
             std::vector<double>& out) {
  const YAML::Node data = DataOf(node);
  if (!data.IsDefined()) keys.Fail(node, "'" + key + "' has no data");
  if (depth > kDeepest || out.size() > kMostValues)
    keys.Fail(node, "'" + key + "' is no list of numbers: it has too many");
  if (data.IsSequence()) {
    for (const YAML::Node& value : data) Flatten(keys, value, key, depth + 1, out);
    return;
  }
  const std::vector<std::string> words =
      data.IsScalar() ? SplitText(data.Scalar(), " \t\r\n,") : std::vector<std::string>();
  if (words.size() > kMostValues) keys.Fail(node, "'" + key + "' has too many values");
  for (const std::string& word : words) {
    double value = 0;
    if (!YAML::convert<double>::decode(YAML::Node(word), value))
      keys.Fail(data, std::string("'").append(key).append("' is no number: ").append(word));
    if (!std::isfinite(value)) keys.Fail(data, "'" + key + "' is not finite");
    out.push_back(value);
  }
  if (words.empty()) keys.Fail(data, "'" + key + "' is no number");
}

// What OpenCV's FileStorage writes as XML: elements in elements, and texts. Attributes say nothing that the
// names don't.
YAML::Node ParseXml(const std::string& text) {
  struct Element {
    std::string name;
    YAML::Node inner{YAML::NodeType::Map};
    std::size_t begin = 0;
  };
  constexpr std::size_t kDeepestElement = 20;
  std::vector<Element> open(1);
  for (std::size_t at = text.find('<'); at < text.size(); at = text.find('<', at)) {
    const bool comment = text.compare(at, 4, "<!--") == 0;
    const std::size_t end = text.find(comment ? "-->" : ">", at);
    if (end == std::string::npos) break;
    const std::string tag = text.substr(at + 1, end - at - 1);
    if (!tag.empty() && tag[0] == '/') {
      if (open.size() < 2) break;
      const Element closed = open.back();
      open.pop_back();
      YAML::Node value = closed.inner;
      if (closed.inner.size() == 0) value = text.substr(closed.begin, at - closed.begin);
      open.back().inner[closed.name] = value;
    } else if (!comment && !tag.empty() && tag[0] != '?' && tag[0] != '!' && tag.back() != '/' &&
               open.size() < kDeepestElement) {
      open.emplace_back();
      open.back().name = tag.substr(0, tag.find_first_of(" \n"));
      open.back().begin = end + 1;
    }
    at = end;
  }
  const YAML::Node all = open.front().inner["opencv_storage"];
  return all.IsDefined() ? all : open.front().inner;
}

}  // namespace

CalibrationKeys::CalibrationKeys(std::filesystem::path file, const YAML::Node& map, const std::string& prefix)
    : file_(std::move(file)), places_({{map, prefix}}) {}

CalibrationKeys CalibrationKeys::Or(const YAML::Node& map, const std::string& prefix) const {
  CalibrationKeys out = *this;
  if (map.IsDefined() && map.IsMap()) out.places_.push_back({map, prefix});
  return out;
}

CalibrationKeys CalibrationKeys::At(const YAML::Node& map, const std::string& prefix) const {
  return {file_, map, prefix};
}

KeyValue CalibrationKeys::Find(KeyNames names) const {
  for (const Place& place : places_) {
    if (!place.map.IsMap()) continue;
    for (const char* name : names) {
      const YAML::Node found = place.map[place.prefix + name];
      if (found.IsDefined() && !found.IsNull()) return {found, place.prefix + name};
    }
  }
  return {YAML::Node(YAML::NodeType::Undefined), places_.front().prefix + *names.begin()};
}

std::string CalibrationKeys::Word(KeyNames names) const {
  const KeyValue found = Find(names);
  return found && found.node.IsScalar() ? found.node.Scalar() : "";
}

bool CalibrationKeys::IsTrue(KeyNames names) const {
  const KeyValue found = Find(names);
  if (!found) return false;
  bool value = false;
  return YAML::convert<bool>::decode(found.node, value) ? value : Numbers(found).front() != 0;
}

std::optional<double> CalibrationKeys::Number(KeyNames names) const {
  const KeyValue found = Find(names);
  if (!found) return std::nullopt;
  if (!found.node.IsScalar()) Fail(found.node, "'" + found.key + "' is no number");
  const std::vector<double> values = Numbers(found);
  if (values.size() != 1) FailSize(found, values.size(), "1 is needed");
  return values.front();
}

double CalibrationKeys::Needed(KeyNames names) const {
  const std::optional<double> value = Number(names);
  if (!value) Fail(map(), "has no key '" + Find(names).key + "'");
  return *value;
}

std::vector<double> CalibrationKeys::Numbers(const KeyValue& value) const {
  std::vector<double> out;
  Flatten(*this, value.node, value.key, 0, out);
  return out;
}

Pose CalibrationKeys::Transform(const KeyValue& value) const {
  std::vector<double> values = Numbers(value);
  if (values.size() == 12) values.insert(values.end(), {0, 0, 0, 1});
  TransformRows rows{};
  if (values.size() != rows.size()) FailSize(value, values.size(), "16 are needed");
  std::copy(values.begin(), values.end(), rows.begin());
  try {
    if (const std::optional<Pose> T = RigidTransform(rows)) return *T;
  } catch (const InputError& e) {
    Fail(value.node, "'" + value.key + "' " + e.what());
  }
  Fail(value.node, "'" + value.key + "' is zeros");
}

void CalibrationKeys::Fail(const YAML::Node& at, const std::string& what) const {
  const int line = at.IsDefined() ? at.Mark().line + 1 : 0;
  throw InputError(file_.string() + (line > 0 ? ":" + std::to_string(line) : std::string()) + ": " + what);
}

void CalibrationKeys::FailSize(const KeyValue& value, std::size_t size, const std::string& needed) const {
  Fail(value.node, "'" + value.key + "' has " + std::to_string(size) + " values; " + needed);
}

bool HoldsCamera(const CalibrationKeys& outer) {
  const CalibrationKeys keys = WithParts(outer);
  return IsList(keys.Find(kMatrix)) || IsList(keys.Find(kIntrinsics)) ||
         (keys.Has("focal_length") && keys.Has("principal_point")) ||
         (keys.Find(kFx) && keys.Find(kFy) && keys.Find(kCx) && keys.Find(kCy));
}

PinholeCamera CameraOfMatrix(const CalibrationKeys& keys, const KeyValue& matrix) {
  const std::vector<double> v = keys.Numbers(matrix);
  if (v.size() != 9 && v.size() != 12 && v.size() != 16)
    keys.FailSize(matrix, v.size(), "9 are needed, a camera matrix");
  const std::size_t columns = v.size() == 9 ? 3 : 4;
  const auto at = [&](std::size_t row, std::size_t column) { return v[row * columns + column]; };
  const bool by_columns = at(2, 0) != 0 || at(2, 1) != 0;  // Open3D
  if (at(0, 1) != 0 || at(1, 0) != 0 || at(2, 2) != 1 || (by_columns && (at(0, 2) != 0 || at(1, 2) != 0)))
    keys.Fail(matrix.node, "'" + matrix.key +
                               "' is no camera matrix that tutti has (fx, 0, cx; 0, fy, cy; 0, 0, 1): its "
                               "pixels are skewed, or its values in another order");
  return Intrinsics(at(0, 0), at(1, 1), by_columns ? at(2, 0) : at(0, 2), by_columns ? at(2, 1) : at(1, 2));
}

PinholeCamera Intrinsics(double fx, double fy, double cx, double cy) {
  PinholeCamera camera;
  camera.fx = fx;
  camera.fy = fy;
  camera.cx = cx;
  camera.cy = cy;
  return camera;
}

void SetPixels(double width, double height, PinholeCamera& camera) {
  camera.width = internal::PixelsOf(width);
  camera.height = internal::PixelsOf(height);
}

std::string LensName(const CalibrationKeys& keys) {
  if (keys.IsTrue({"fisheye_model", "is_fisheye"})) return "fisheye";
  const KeyValue nested = keys.Find({"distortion"});  // maplab
  std::string lens = keys.Word(kLensModel);
  if (lens.empty() && nested && nested.node.IsMap()) lens = keys.At(nested.node).Word({"type", "model"});
  if (lens.empty() && nested && nested.node.IsScalar() && !IsNumberNode(nested.node))
    lens = nested.node.Scalar();
  const KeyValue camera = keys.Find(kCameraModel);
  std::string model = keys.Word(kCameraModel);
  if (lens.empty()) return model;
  PinholeCamera any;
  const std::string wrong = internal::SetLens(model, {0, 0, 0, 0}, any);
  if (!wrong.empty()) keys.Fail(camera.node, camera.key + " '" + model + "': " + wrong);
  return lens;
}

PinholeCamera CameraOfKeys(const CalibrationKeys& outer, std::string* note) {
  const CalibrationKeys keys = WithParts(outer);
  const std::string lens = LensName(keys);
  PinholeCamera any;
  const std::string wrong = internal::SetLens(lens, {0, 0, 0, 0}, any);  // before its values are missing
  if (!wrong.empty()) keys.Fail(keys.Find(kAnyModel).node, wrong);
  PinholeCamera camera = IntrinsicsOf(keys);
  SetLensOf(keys, keys.Find(kLens), lens, camera, note);
  SetSize(keys, camera);
  const ImageWindow window = WindowOf(keys);
  if (!window.IsWhole()) *note = window.Text() + " applied";
  return Windowed(camera, window, keys.file().string());
}

PinholeCamera CameraOfMatrices(const CalibrationKeys& keys, const char* matrix, const char* coefficients,
                               const std::string& lens, std::string* note) {
  PinholeCamera camera = CameraOfMatrix(keys, keys.Find({matrix}));
  SetSize(keys, camera);
  const KeyValue list = keys.Find({coefficients});
  if (!list) keys.Fail(keys.map(), std::string("has no key '") + coefficients + "'");
  SetLensOf(keys, list, lens, camera, note);
  return camera;
}

// Text that a YAML parser takes: OpenCV's has "%YAML:1.0" and "data:[1", JSON has tabs.
std::string ReadCalibrationText(const std::filesystem::path& file) {
  constexpr std::size_t kMostBytes = 10'000'000;
  std::istringstream in(
      internal::ReadText(file, "--calibration needs the file of a calibration", kMostBytes));
  std::string text;
  for (std::string line; std::getline(in, line);) {
    if (line.rfind("%YAML", 0) == 0) line.clear();
    std::replace(line.begin(), line.end(), '\t', ' ');
    bool first = true;  // the key that the line begins with
    for (std::size_t i = 1; i + 1 < line.size(); ++i) {
      const auto is_key = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; };
      const bool list = line[i + 1] == '[' || line[i + 1] == '{';
      const bool value = std::isdigit(static_cast<unsigned char>(line[i + 1])) != 0 || line[i + 1] == '-';
      if (is_key(line[i - 1]) && line[i] == ':' && (list || (first && value))) line.insert(i + 1, " ");
      first = first && (is_key(line[i]) || line[i] == '.' || line[i] == ' ');
    }
    text += line + "\n";
  }
  return text;
}

CalibrationDocument ParseCalibration(const std::filesystem::path& file, const std::string& text, bool pairs) {
  YAML::Node root;
  const std::size_t first = text.find_first_not_of(" \n");
  try {
    root = first < text.size() && text[first] == '<' ? ParseXml(text) : YAML::Load(text);
  } catch (const YAML::Exception& e) {
    throw InputError(file.string() + ":" + std::to_string(e.mark.line + 1) + ": not valid YAML: " + e.msg);
  }
  if (!root.IsMap()) throw InputError(file.string() + ": holds no keys; " + kKnownCalibrations);
  return {CalibrationKeys(file, root), text, pairs};
}

}  // namespace tutti
