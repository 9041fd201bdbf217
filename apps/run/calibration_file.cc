#include "apps/run/calibration_file.h"

#include <array>
#include <cmath>
#include <utility>

#include "apps/run/calibration_keys.h"
#include "tutti/core/error.h"
#include "tutti/slam/config.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// The odometry benchmark (P0), raw recordings and KITTI-360 (P_rect_00) give rectified images.
Calibration FromKitti(const CalibrationDocument& file) {
  for (const auto& [left, right] :
       {std::pair("P0", "P1"), std::pair("P2", "P3"), std::pair("P_rect_00", "P_rect_01")}) {
    const KeyValue P = file.Find({left}), P_right = file.Find({right});
    if (!P) continue;
    Calibration out;
    out.format = std::string("KITTI, ") + left + " of rectified images";
    const std::array<double, 12> of_left = file.Array<12>(P);
    out.camera = CameraOfMatrix(file, P);
    if (P_right) {
      const std::array<double, 12> of_right = file.Array<12>(P_right);
      out.baseline_m = std::abs(of_left[3] / of_left[0] - of_right[3] / of_right[0]);
    }
    return out;
  }
  return {};
}

// --- nerfstudio and instant-ngp

void CheckFrames(const CalibrationDocument& file, const YAML::Node& frames) {
  for (const YAML::Node& frame : frames) {
    if (!frame.IsMap()) file.Fail(frame, "'frames' is no list of frames");
    for (const char* name : {"fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "k4", "p1", "p2"}) {
      if (file.At(frame).Number({name}) != file.At(frames[0]).Number({name}))
        file.Fail(frame, std::string("this frame has another '") + name +
                             "' than the first one; one camera for all images is needed");
    }
  }
}

Calibration FromNerf(const CalibrationDocument& file) {
  const YAML::Node frames = file["frames"];
  CalibrationKeys keys = file;
  if (frames.IsDefined() && frames.IsSequence() && frames.size() > 0) {
    CheckFrames(file, frames);
    keys = file.At(frames[0]).Or(file.map());
  }
  const std::optional<double> width = keys.Number({"w"}), height = keys.Number({"h"});
  std::optional<double> focal = keys.Number({"fl_x"});
  if (const std::optional<double> view = keys.Number({"camera_angle_x"}); view && !focal) {
    if (!width)
      keys.Fail(keys.map(),
                "has camera_angle_x, but not the image width (w), without which it is no focal length");
    if (!(*view > 0 && *view < 3)) keys.Fail(keys.map(), "'camera_angle_x' is no field of view in radians");
    focal = 0.5 * *width / std::tan(0.5 * *view);
  }
  YAML::Node usual(YAML::NodeType::Map);  // what both programs take where a value is missing
  if (focal) usual["fl_x"] = usual["fl_y"] = *focal;
  if (width) usual["cx"] = 0.5 * *width;
  if (height) usual["cy"] = 0.5 * *height;
  keys = keys.Or(usual);
  Calibration out = OneCamera(keys, "nerfstudio");
  out.camera.cx -= 0.5;  // (0, 0) is the corner of the first pixel, not its centre
  out.camera.cy -= 0.5;
  return out;
}

// --- OpenCV's pairs; a camera alone, or somewhere in a file

// Matrices of two cameras, and the right one's place, as cv::stereoCalibrate gives them.
struct PairNames {
  const char *K_left, *D_left, *K_right, *D_right;
};
constexpr PairNames kPairs[] = {{"K1", "D1", "K2", "D2"},
                                {"M1", "D1", "M2", "D2"},
                                {"cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2"}};

const PairNames* PairOf(const CalibrationDocument& file) {
  for (const PairNames& names : kPairs) {
    if (file[names.K_left].IsDefined()) return &names;
  }
  return nullptr;
}

Calibration FromPair(const CalibrationDocument& file) {
  const PairNames& names = *PairOf(file);
  const CalibrationKeys& keys = file;
  const std::string lens = LensName(keys);
  std::string note;
  Calibration out;
  out.camera = CameraOfMatrices(keys, names.K_left, names.D_left, lens, &note);
  out.format = std::string("OpenCV, ") + names.K_left + (note.empty() ? "" : ", " + note);
  const KeyValue R = keys.Find({"R"}), t = keys.Find({"T"});
  if (!file.pairs || !R || !t || !keys.Has(names.K_right)) return out;
  const std::array<double, 9> r = keys.Array<9>(R);
  const std::array<double, 3> p = keys.Array<3>(t);
  const std::optional<Pose> T =
      RigidTransform({r[0], r[1], r[2], p[0], r[3], r[4], r[5], p[1], r[6], r[7], r[8], p[2], 0, 0, 0, 1});
  if (T) SetRight(keys, CameraOfMatrices(keys, names.K_right, names.D_right, lens, &note), *T, out);
  return out;
}

// Others have a section of that name, too, with keys that tutti's has not.
bool IsTuttis(const CalibrationDocument& file) {
  const YAML::Node camera = file["camera"];
  return camera.IsDefined() && camera.IsMap() &&
         !file.At(camera).Find({"w", "W", "cols", "image_width", "k1", "k2", "model", "camera_model",
                                "distortion_model", "distortion_coefficients", "dist_coeffs", "intrinsics"});
}

Calibration FromTutti(const CalibrationDocument& file) {
  const RunConfig config = ParseConfig(file.text, file.file().string());
  Calibration out;
  out.format = "tutti";
  if (config.dataset.camera) out.camera = *config.dataset.camera;
  out.baseline_m = config.dataset.baseline_m;
  out.rate_hz = config.dataset.rate_hz;
  out.depth_units_per_m = config.dataset.depth_units_per_m;
  if (file.pairs) out.right = config.dataset.right;
  if (out.right) out.T_right_left = config.dataset.T_right_left;
  return out;
}

std::string NameOf(const CalibrationKeys& keys) {
  const auto has = [&](KeyNames names) { return static_cast<bool>(keys.Find(names)); };
  if (has({"intrinsic_matrix"})) return "Open3D";
  if (has({"ppx"})) return "RealSense";
  if (has({"camera_name", "projection_matrix", "binning_x", "P", "p"})) return "ROS";
  if (has({"camera_matrix", "Camera_Matrix", "cameraMatrix", "K"})) return "OpenCV";
  if (has({"intrinsics"})) return has({"distortion_coeffs"}) ? "Kalibr" : "EuRoC";
  return "fx, fy, cx, cy";
}

// Cameras anywhere in a file, by their keys; of `most` nodes, to any sensible depth.
struct Found {
  std::string name;
  YAML::Node node;
};
void FindCameras(const CalibrationDocument& file, const YAML::Node& node, const std::string& name, int depth,
                 int& most, std::vector<Found>& out) {
  constexpr int kDeepest = 5;
  if (depth > kDeepest || --most < 0) return;
  if (file.IsCamera(node)) {
    out.push_back({name, node});
  } else if (node.IsMap() || node.IsSequence()) {
    std::size_t i = 0;
    for (auto it = node.begin(); it != node.end(); ++it, ++i) {
      const bool keyed = node.IsMap() && it->first.IsScalar();
      FindCameras(file, node.IsMap() ? it->second : *it,
                  keyed ? it->first.Scalar() : name + "[" + std::to_string(i) + "]", depth + 1, most, out);
    }
  }
}

// --- which of them

// A format is known by the first of its keys that the file has; kSection: whose value is a section.
enum class Kind { kAny, kSection };
struct Format {
  KeyNames keys;
  Kind kind;
  Calibration (*read)(const CalibrationDocument& file);
};
const Format kFormats[] = {
    {{"value0"}, Kind::kSection, FromBasalt},
    {{"model_type", "cam0_calib"}, Kind::kAny, FromVins},
    {{"Camera1.fx", "Camera.fx", "Camera.model", "Camera.type"}, Kind::kAny, FromOrbSlam},
    {{"Camera"}, Kind::kSection, FromStella},
    {{"fl_x", "camera_angle_x", "frames"}, Kind::kAny, FromNerf},
    {{"P0", "P2", "P_rect_00"}, Kind::kAny, FromKitti},
    {{"K1", "M1", "cameraMatrix1"}, Kind::kAny, FromPair}};

Calibration Read(const CalibrationDocument& file) {
  if (!CamerasOfChain(file).empty()) return FromChain(file);
  for (const Format& format : kFormats) {
    const KeyValue found = file.Find(format.keys);
    if (found && (format.kind == Kind::kAny || found.node.IsMap())) return format.read(file);
  }
  if (IsTuttis(file)) return FromTutti(file);
  std::vector<Found> cameras;
  int most = 1000;
  FindCameras(file, file.map(), "", 0, most, cameras);
  if (cameras.empty())
    throw InputError(file.file().string() + ": holds no calibration; " + kKnownCalibrations);
  const Found& first = cameras.front();
  const CalibrationKeys keys = file.At(first.node);
  Calibration out = OneCamera(keys, NameOf(keys));
  if (cameras.size() > 1)
    out.format += ", " + first.name + ", the first of " + std::to_string(cameras.size()) + " cameras";
  return out;
}

}  // namespace

Calibration ReadCalibration(const fs::path& file, bool pairs) {
  const std::string text = ReadCalibrationText(file);
  Calibration out;
  if (const std::optional<Calibration> table = ReadCalibrationTable(file, text)) {
    out = *table;
  } else {
    const CalibrationDocument keys = ParseCalibration(file, text, pairs);
    try {
      out = Read(keys);
    } catch (const YAML::Exception& e) {
      throw InputError(file.string() + ":" + std::to_string(e.mark.line + 1) + ": can't be read: " + e.msg);
    }
  }
  CheckCalibrated(file, out.camera);
  if (out.right) CheckCalibrated(file, *out.right, "right ");
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
