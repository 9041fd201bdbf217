#include "apps/run/calibration_file.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <sstream>
#include <vector>

#include "core/camera_text.h"
#include "core/text_reader.h"
#include "frontend/dataset/sensor_yaml.h"
#include "tutti/core/error.h"
#include "tutti/slam/config.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

/// A YAML file with errors that name it.
class CalibrationText {
 public:
  explicit CalibrationText(const fs::path& file) : file_(file) {
    constexpr std::size_t kMostBytes = 10'000'000;
    std::istringstream in(internal::ReadText(
        file, "--calibration needs a YAML file of Kalibr, ORB-SLAM, OpenCV or ROS", kMostBytes));
    std::string line;
    while (std::getline(in, line)) {
      // OpenCV's "%YAML:1.0" is no YAML.
      text_ += (line.rfind("%YAML", 0) == 0 ? std::string() : line) + "\n";
    }
    try {
      root_ = YAML::Load(text_);
    } catch (const YAML::Exception& e) {
      throw InputError(file.string() + ":" + std::to_string(e.mark.line + 1) + ": not valid YAML: " + e.msg);
    }
    if (!root_.IsMap()) throw InputError(file.string() + ": holds no keys; " + Known());
  }

  static std::string Known() {
    return "the formats that are known are those of Kalibr (cam0: intrinsics), ORB-SLAM (Camera.fx or "
           "Camera1.fx), OpenCV and ROS (camera_matrix), EuRoC (intrinsics) and tutti (camera: fx)";
  }
  const fs::path& file() const { return file_; }
  const std::string& text() const { return text_; }
  const YAML::Node& root() const { return root_; }

  [[noreturn]] void Fail(const YAML::Node& at, const std::string& what) const {
    const int line = at.IsDefined() ? at.Mark().line + 1 : 0;
    throw InputError(file_.string() + (line > 0 ? ":" + std::to_string(line) : std::string()) + ": " + what);
  }
  double Number(const YAML::Node& node, const std::string& key) const {
    double value = 0;
    try {
      value = node.as<double>();
    } catch (const YAML::Exception&) {
      Fail(node, "'" + key + "' is no number");
    }
    if (!std::isfinite(value)) Fail(node, "'" + key + "' is not finite");
    return value;
  }
  std::optional<double> Number(const std::string& key) const {
    const YAML::Node node = root_[key];
    if (!node.IsDefined()) return std::nullopt;
    return Number(node, key);
  }
  double Needed(const std::string& key) const {
    const std::optional<double> value = Number(key);
    if (!value) throw InputError(file_.string() + ": has no key '" + key + "'");
    return *value;
  }
  std::vector<double> Numbers(const YAML::Node& node, const std::string& key) const {
    if (!node.IsSequence()) Fail(node, "'" + key + "' is no list of numbers");
    std::vector<double> values;
    for (const YAML::Node& value : node) values.push_back(Number(value, key));
    return values;
  }
  // A matrix of OpenCV or ROS ({rows, cols, data}), or a plain list.
  std::vector<double> Matrix(const YAML::Node& node, const std::string& key) const {
    if (node.IsMap() && !node["data"].IsDefined()) Fail(node, "'" + key + "' has no data");
    return Numbers(node.IsMap() ? node["data"] : node, key);
  }

 private:
  fs::path file_;
  std::string text_;
  YAML::Node root_;
};

void SetLens(const CalibrationText& text, const YAML::Node& at, const std::string& model,
             const std::vector<double>& values, PinholeCamera& camera) {
  bool all_zero = true;
  for (const double value : values) all_zero = all_zero && value == 0;
  if (all_zero) return;
  const bool fisheye = model == "equidistant" || model == "equi" || model == "fisheye" ||
                       model == "KannalaBrandt8" || model == "kannala_brandt";
  const bool radtan = model.empty() || model == "radtan" || model == "plumb_bob" ||
                      model == "radial-tangential" || model == "PinHole";
  if (!fisheye && !radtan)
    text.Fail(at, "the lens model '" + model +
                      "' is not known; tutti has radtan (plumb_bob) and equidistant "
                      "(fisheye)");
  const std::size_t most = fisheye ? 4 : 5;
  if (values.size() < 4 || values.size() > 14)
    text.Fail(at, "the lens has " + std::to_string(values.size()) + " coefficients; 4 or 5 are needed");
  for (std::size_t i = most; i < values.size(); ++i) {
    if (values[i] != 0)
      text.Fail(at, "the lens has more than " + std::to_string(most) +
                        " coefficients (a rational model?); calibrate with radtan or equidistant");
  }
  camera.distortion = fisheye ? Distortion::kEquidistant : Distortion::kRadTan;
  for (std::size_t i = 0; i < std::min(most, values.size()); ++i) camera.coefficients[i] = values[i];
}

void SetIntrinsics(const CalibrationText& text, const YAML::Node& at, const std::vector<double>& values,
                   PinholeCamera& camera) {
  if (values.size() != 4)
    text.Fail(at, "'intrinsics' has " + std::to_string(values.size()) + " values; fx, fy, cx, cy are needed");
  camera.fx = values[0];
  camera.fy = values[1];
  camera.cx = values[2];
  camera.cy = values[3];
}

void SetSize(const CalibrationText& text, const YAML::Node& size, PinholeCamera& camera) {
  if (!size.IsDefined()) return;
  const std::vector<double> values = text.Numbers(size, "resolution");
  if (values.size() != 2) text.Fail(size, "'resolution' needs width and height");
  camera.width = internal::PixelsOf(values[0]);
  camera.height = internal::PixelsOf(values[1]);
}

std::string Word(const YAML::Node& node) { return node.IsDefined() && node.IsScalar() ? node.Scalar() : ""; }

// Kalibr's cam0, or what stands there alone.
Calibration FromKalibr(const CalibrationText& text, const YAML::Node& node) {
  Calibration out;
  out.format = "Kalibr";
  const std::string model = Word(node["camera_model"]);
  if (!model.empty() && model != "pinhole")
    text.Fail(node["camera_model"], "camera_model '" + model + "': tutti has pinhole alone");
  SetIntrinsics(text, node, text.Numbers(node["intrinsics"], "intrinsics"), out.camera);
  SetSize(text, node["resolution"], out.camera);
  const YAML::Node lens = node["distortion_coeffs"];
  if (lens.IsDefined() && Word(node["distortion_model"]) != "none") {
    SetLens(text, lens, Word(node["distortion_model"]), text.Numbers(lens, "distortion_coeffs"), out.camera);
  }
  if (node["rate_hz"].IsDefined()) out.rate_hz = text.Number(node["rate_hz"], "rate_hz");
  return out;
}

// A matrix of 4 rows in any of the forms.
Pose TransformOf(const CalibrationText& text, const YAML::Node& node, const std::string& key) {
  std::vector<double> values;
  if (node.IsSequence() && node.size() == 4) {
    for (const YAML::Node& row : node) {
      for (const double value : text.Numbers(row, key)) values.push_back(value);
    }
  } else {
    values = text.Matrix(node, key);
  }
  TransformRows rows{};
  if (values.size() != rows.size())
    text.Fail(node, "'" + key + "' has " + std::to_string(values.size()) + " values; 16 are needed");
  std::copy(values.begin(), values.end(), rows.begin());
  try {
    if (const std::optional<Pose> T = RigidTransform(rows)) return *T;
  } catch (const InputError& e) {
    text.Fail(node, "'" + key + "' " + e.what());
  }
  text.Fail(node, "'" + key + "' is zeros");
}

void SetRight(const PinholeCamera& right, const Pose& T_right_left, Calibration& out) {
  out.right = right;
  const Eigen::Matrix4d matrix = T_right_left.Matrix();
  for (std::size_t i = 0; i < out.T_right_left.size(); ++i)
    out.T_right_left[i] = matrix(static_cast<int>(i) / 4, static_cast<int>(i) % 4);
  out.baseline_m = 0;
}

// cam1 of a camchain, where it says how it stands to cam0.
void AddKalibrRight(const CalibrationText& text, Calibration& out) {
  const YAML::Node cam1 = text.root()["cam1"];
  if (!cam1.IsDefined() || !cam1.IsMap() || !cam1["T_cn_cnm1"].IsDefined()) return;
  SetRight(FromKalibr(text, cam1).camera, TransformOf(text, cam1["T_cn_cnm1"], "T_cn_cnm1"), out);
}

Calibration FromEuroc(const CalibrationText& text) {
  const SensorYaml read = ReadSensorYaml(text.file());
  Calibration out;
  out.format = "EuRoC";
  out.camera = read.camera;
  out.rate_hz = read.rate_hz.value_or(0);
  return out;
}

// `prefix`: "Camera.", "Camera1.", "Camera2.".
PinholeCamera OrbSlamCamera(const CalibrationText& text, const std::string& prefix) {
  PinholeCamera c;
  c.fx = text.Needed(prefix + "fx");
  c.fy = text.Needed(prefix + "fy");
  c.cx = text.Needed(prefix + "cx");
  c.cy = text.Needed(prefix + "cy");
  c.width = internal::PixelsOf(text.Number("Camera.width").value_or(0));
  c.height = internal::PixelsOf(text.Number("Camera.height").value_or(0));
  const std::string model = Word(text.root()["Camera.type"]);
  const bool fisheye = model == "KannalaBrandt8";
  std::vector<double> lens;
  for (const char* key : {"k1", "k2", fisheye ? "k3" : "p1", fisheye ? "k4" : "p2"})
    lens.push_back(text.Number(prefix + key).value_or(0));
  if (!fisheye) lens.push_back(text.Number(prefix + "k3").value_or(0));
  if (model != "Rectified") SetLens(text, text.root()["Camera.type"], model, lens, c);
  return c;
}

Calibration FromOrbSlam(const CalibrationText& text, bool pairs) {
  Calibration out;
  const bool three = text.root()["Camera1.fx"].IsDefined();
  out.format = three ? "ORB-SLAM3" : "ORB-SLAM";
  out.camera = OrbSlamCamera(text, three ? "Camera1." : "Camera.");
  out.rate_hz = text.Number("Camera.fps").value_or(0);
  out.depth_units_per_m =
      text.Number("RGBD.DepthMapFactor").value_or(text.Number("DepthMapFactor").value_or(0));
  out.baseline_m = text.Number("Stereo.b").value_or(0);
  if (const std::optional<double> bf = text.Number("Camera.bf");
      bf && out.baseline_m == 0 && out.camera.fx > 0)
    out.baseline_m = *bf / out.camera.fx;
  const YAML::Node pose = text.root()["Stereo.T_c1_c2"];  // of the right camera in the left one's frame
  if (pairs && pose.IsDefined() && text.root()["Camera2.fx"].IsDefined())
    SetRight(OrbSlamCamera(text, "Camera2."), TransformOf(text, pose, "Stereo.T_c1_c2").Inverse(), out);
  return out;
}

YAML::Node FirstOf(const YAML::Node& root, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (root[name].IsDefined()) return root[name];
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

Calibration FromMatrix(const CalibrationText& text, const YAML::Node& matrix) {
  Calibration out;
  const YAML::Node& root = text.root();
  out.format = root["camera_name"].IsDefined() || root["projection_matrix"].IsDefined() ? "ROS" : "OpenCV";
  const std::vector<double> k = text.Matrix(matrix, "camera_matrix");
  if (k.size() != 9)
    text.Fail(matrix, "the camera matrix has " + std::to_string(k.size()) + " values; 9 are needed");
  out.camera.fx = k[0];
  out.camera.cx = k[2];
  out.camera.fy = k[4];
  out.camera.cy = k[5];
  const YAML::Node width = FirstOf(root, {"image_width", "image_Width", "width"});
  const YAML::Node height = FirstOf(root, {"image_height", "image_Height", "height"});
  if (width.IsDefined() && height.IsDefined()) {
    out.camera.width = internal::PixelsOf(text.Number(width, "image_width"));
    out.camera.height = internal::PixelsOf(text.Number(height, "image_height"));
  }
  const YAML::Node lens = FirstOf(root, {"distortion_coefficients", "Distortion_Coefficients", "dist_coeffs",
                                         "distCoeffs", "dist_coeff", "D"});
  if (lens.IsDefined()) {
    SetLens(text, lens, Word(FirstOf(root, {"distortion_model", "camera_model"})),
            text.Matrix(lens, "distortion_coefficients"), out.camera);
  }
  return out;
}

Calibration FromTutti(const CalibrationText& text, bool pairs) {
  const RunConfig config = ParseConfig(text.text(), text.file().string());
  Calibration out;
  out.format = "tutti";
  if (config.dataset.camera) out.camera = *config.dataset.camera;
  out.baseline_m = config.dataset.baseline_m;
  out.rate_hz = config.dataset.rate_hz;
  out.depth_units_per_m = config.dataset.depth_units_per_m;
  if (pairs) out.right = config.dataset.right;
  if (out.right) out.T_right_left = config.dataset.T_right_left;
  return out;
}

Calibration KalibrOf(const CalibrationText& text, bool pairs) {
  Calibration out = FromKalibr(text, text.root()["cam0"]);
  if (pairs) AddKalibrRight(text, out);
  return out;
}

Calibration Read(const CalibrationText& text, bool pairs) {
  const YAML::Node& root = text.root();
  if (root["cam0"].IsDefined() && root["cam0"].IsMap() && root["cam0"]["intrinsics"].IsDefined())
    return KalibrOf(text, pairs);
  if (root["intrinsics"].IsDefined() && root["distortion_coeffs"].IsDefined()) return FromKalibr(text, root);
  if (root["intrinsics"].IsDefined()) return FromEuroc(text);
  if (root["Camera1.fx"].IsDefined() || root["Camera.fx"].IsDefined()) return FromOrbSlam(text, pairs);
  if (root["camera"].IsDefined() && root["camera"].IsMap()) return FromTutti(text, pairs);
  const YAML::Node matrix = FirstOf(root, {"camera_matrix", "Camera_Matrix", "cameraMatrix", "K"});
  if (matrix.IsDefined()) return FromMatrix(text, matrix);
  throw InputError(text.file().string() + ": holds no calibration; " + CalibrationText::Known());
}

// `which`: "right ", or "".
void Check(const fs::path& file, const std::string& which, PinholeCamera camera) {
  if (camera.width == 0 || camera.height == 0) {  // of the images, later
    camera.width = internal::PixelsOf(std::round(2 * std::max(1.0, camera.cx)));
    camera.height = internal::PixelsOf(std::round(2 * std::max(1.0, camera.cy)));
  }
  const std::string problem = camera.Validate();
  if (!problem.empty()) throw InputError(file.string() + ": " + which + problem);
}

}  // namespace

Calibration ReadCalibration(const fs::path& file, bool pairs) {
  const CalibrationText text(file);
  Calibration out = Read(text, pairs);
  Check(file, "", out.camera);
  if (out.right) Check(file, "right ", *out.right);
  return out;
}

std::optional<fs::path> CalibrationBeside(const fs::path& folder) {
  std::error_code ignored;
  for (const char* name : {"calibration.yaml", "calibration.yml", "camera.yaml", "camera.yml", "calib.yaml",
                           "calib.yml", "camera_info.yaml", "camchain.yaml", "sensor.yaml", "ost.yaml"}) {
    if (fs::is_regular_file(folder / name, ignored)) return folder / name;
  }
  return std::nullopt;
}

}  // namespace tutti
