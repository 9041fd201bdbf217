// Readers of the calibrations that SLAM and odometry programs write, one for each format.
#include <Eigen/Geometry>

#include <cmath>
#include <tuple>

#include "apps/run/calibration_keys.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// Left camera -> right camera, from the transforms of either to a body. `to_body`: T_body_camera.
std::optional<Pose> ThroughBody(const CalibrationKeys& left, const CalibrationKeys& right, const char* name,
                                bool to_body) {
  const KeyValue of_left = left.Find({name}), of_right = right.Find({name});
  if (!of_left || !of_right) return std::nullopt;
  const Pose l = left.Transform(of_left), r = right.Transform(of_right);
  return to_body ? r.Inverse() * l : r * l.Inverse();
}

/// A camera of raw pairs, and the rotation that rectifies it.
struct RawCamera {
  CalibrationKeys keys;
  const char *K, *D, *R;
};

// In place of the camera of the rectified images, which such a file names beside them.
void TakeRawPairs(const RawCamera& left, const RawCamera& right, const std::string& lens, bool pairs,
                  Calibration& out) {
  const double baseline_m = out.baseline_m;
  const auto camera = [&](const RawCamera& of) {
    std::string unused;
    PinholeCamera raw = CameraOfMatrices(of.keys, of.K, of.D, lens, &unused);
    if (raw.width == 0) std::tie(raw.width, raw.height) = std::tie(out.camera.width, out.camera.height);
    return raw;
  };
  const auto rotation = [](const RawCamera& of) {
    const KeyValue R = of.keys.Find({of.R});
    if (!R)
      of.keys.Fail(of.keys.map(), "has no key '" + R.key +
                                      "', without which these raw pairs can't be rectified; if the pairs are "
                                      "rectified already, leave out all keys of raw ones");
    return of.keys.Array<9>(R);
  };
  const PinholeCamera raw = camera(left);
  if (pairs) {
    const std::array<double, 9> R_left = rotation(left), R_right = rotation(right);
    const PinholeCamera raw_right = camera(right);
    if (!(baseline_m > 0))
      left.keys.Fail(left.keys.map(),
                     "says how pairs are rectified, but not how far apart the cameras are (Camera.bf or "
                     "focal_x_baseline)");
    Pose T;
    try {
      T = TransformOfRectified(R_left, R_right, baseline_m);
    } catch (const InputError& e) {
      left.keys.Fail(left.keys.Find({left.R}).node,
                     std::string("'R' of the left or right camera ") + e.what());
    }
    SetRight(right.keys, raw_right, T, out);
  }
  out.camera = raw;
  out.baseline_m = 0;
  out.format += ", the left one of raw pairs";
}

// Common to flat keys ("Camera.fx") and stella_vslam's sections.
Calibration OneOfSlam(const CalibrationDocument& file, const CalibrationKeys& keys,
                      const std::string& format) {
  Calibration out = OneCamera(keys, format);
  const CalibrationKeys outside = file.Or(file["Preprocessing"]).Or(file.map(), "RGBD.");
  if (out.depth_units_per_m == 0)
    out.depth_units_per_m = outside.Number({"DepthMapFactor", "depthmap_factor"}).value_or(0);
  out.baseline_m = file.Number({"Stereo.b"}).value_or(0);
  if (const std::optional<double> bf = keys.Number({"bf", "focal_x_baseline"});
      bf && out.baseline_m == 0 && out.camera.fx > 0)
    out.baseline_m = std::abs(*bf) / out.camera.fx;
  return out;
}

TransformRows RowsOf(const Pose& T) {
  const Eigen::Matrix4d matrix = T.Matrix();
  TransformRows rows{};
  for (std::size_t i = 0; i < rows.size(); ++i)
    rows[i] = matrix(static_cast<int>(i) / 4, static_cast<int>(i) % 4);
  return rows;
}

// How the IMU is mounted; `camera_key` is T_camera_imu, `imu_key` T_imu_camera, if either is there. Image
// times plus `shift_key` are the IMU's.
void TakeImu(const CalibrationKeys& keys, const char* camera_key, const char* imu_key, const char* shift_key,
             Calibration& out) {
  if (const KeyValue T = keys.Find({camera_key}))
    out.T_camera_imu = RowsOf(keys.Transform(T));
  else if (const KeyValue inverse = keys.Find({imu_key}))
    out.T_camera_imu = RowsOf(keys.Transform(inverse).Inverse());
  out.imu_offset_s = -keys.Number({shift_key}).value_or(0);
}

Pose PoseOfBasalt(const CalibrationKeys& keys) {
  const Eigen::Quaterniond q(keys.Needed({"qw"}), keys.Needed({"qx"}), keys.Needed({"qy"}),
                             keys.Needed({"qz"}));
  if (!(std::abs(q.norm() - 1) < 0.01)) keys.Fail(keys.map(), "the quaternion's length is not 1");
  return {q.normalized(), {keys.Needed({"px"}), keys.Needed({"py"}), keys.Needed({"pz"})}};
}

}  // namespace

Calibration OneCamera(const CalibrationKeys& keys, const std::string& format) {
  Calibration out;
  std::string note;
  out.camera = CameraOfKeys(keys, &note);
  out.format = format + (note.empty() ? "" : ", " + note);
  out.rate_hz = keys.Number({"rate_hz", "fps"}).value_or(0);
  const double depth =
      keys.Number({"depthmap_factor", "png_depth_scale", "depth_scale", "scale"}).value_or(0);
  constexpr double kFewest = 10;  // units a metre; below 1: metres a unit (RealSense)
  if (depth >= kFewest) out.depth_units_per_m = depth;
  if (depth > 0 && depth <= 1 / kFewest) out.depth_units_per_m = 1 / depth;
  return out;
}

void SetRight(const CalibrationKeys& keys, const PinholeCamera& right, const Pose& T_right_left,
              Calibration& out) {
  constexpr double kWidest = 10;  // [m]
  if (!(T_right_left.translation.norm() <= kWidest))
    keys.Fail(keys.map(), "the two cameras lie " + std::to_string(T_right_left.translation.norm()) +
                              " m apart; are these millimetres? Metres are needed");
  out.right = right;
  out.T_right_left = RowsOf(T_right_left);
  out.baseline_m = 0;
}

void CheckCalibrated(const fs::path& file, PinholeCamera camera, const char* which) {
  if (camera.width == 0 || camera.height == 0)  // of the images, later
    SetPixels(std::round(2 * std::max(1.0, camera.cx)), std::round(2 * std::max(1.0, camera.cy)), camera);
  const std::string problem = camera.Validate();
  if (!problem.empty()) throw InputError(file.string() + ": " + which + problem);
}

std::vector<std::string> CamerasOfChain(const CalibrationDocument& file) {
  std::vector<std::string> names;
  for (int i = 0; i < 10; ++i) {
    const std::string name = "cam" + std::to_string(i);
    if (file.IsCamera(file[name.c_str()])) names.push_back(name);
  }
  return names;
}

Calibration FromChain(const CalibrationDocument& file) {
  const std::vector<std::string> names = CamerasOfChain(file);
  const CalibrationKeys left = file.At(file[names[0].c_str()]);
  Calibration out = OneCamera(left, "Kalibr");
  if (names.size() > 1) out.format += ", " + names[0] + " of " + std::to_string(names.size());
  TakeImu(left, "T_cam_imu", "T_imu_cam", "timeshift_cam_imu", out);
  if (!file.pairs || names.size() < 2) return out;
  const CalibrationKeys right = file.At(file[names[1].c_str()]);
  std::optional<Pose> T;
  if (const KeyValue direct = right.Find({"T_cn_cnm1"})) {
    T = right.Transform(direct);
  } else if (!(T = ThroughBody(left, right, "T_imu_cam", true))) {
    T = ThroughBody(left, right, "T_cam_imu", false);
  }
  std::string unused;
  if (T) SetRight(right, CameraOfKeys(right, &unused), *T, out);
  return out;
}

Calibration FromOrbSlam(const CalibrationDocument& file) {
  const YAML::Node& root = file.map();
  const bool three = file["Camera1.fx"].IsDefined();
  const CalibrationKeys flat = file.At(root, "Camera.");
  const CalibrationKeys left = three ? file.At(root, "Camera1.").Or(root, "Camera.") : flat;
  Calibration out = OneOfSlam(file, left, three ? "ORB-SLAM3" : flat.Has("model") ? "OpenVSLAM" : "ORB-SLAM");
  const CalibrationKeys raw_left = file.At(root, "LEFT."), raw_right = file.At(root, "RIGHT.");
  const CalibrationKeys stella = file.At(root, "StereoRectifier.");
  if (raw_left.Has("K")) {
    TakeRawPairs({raw_left, "K", "D", "R"}, {raw_right, "K", "D", "R"}, "radtan", file.pairs, out);
  } else if (stella.Has("K_left")) {
    TakeRawPairs({stella, "K_left", "D_left", "R_left"}, {stella, "K_right", "D_right", "R_right"},
                 stella.Word({"model"}), file.pairs, out);
  }
  TakeImu(file, "", file.Has("IMU.T_b_c1") ? "IMU.T_b_c1" : "Tbc", "", out);
  // The pose is that of the right camera in the left one's frame.
  const KeyValue pose = file.Find({"Stereo.T_c1_c2", "Tlr"});
  const CalibrationKeys right = file.At(root, "Camera2.").Or(root, "Camera.");
  if (!file.pairs || out.right || !pose || !file["Camera2.fx"].IsDefined()) return out;
  std::string unused;
  SetRight(right, CameraOfKeys(right, &unused), file.Transform(pose).Inverse(), out);
  return out;
}

Calibration FromStella(const CalibrationDocument& file) {
  Calibration out = OneOfSlam(file, file.At(file["Camera"]), "stella_vslam");
  const YAML::Node section = file["StereoRectifier"];
  if (!section.IsDefined() || !section.IsMap()) return out;
  const CalibrationKeys raw = file.At(section);
  TakeRawPairs({raw, "K_left", "D_left", "R_left"}, {raw, "K_right", "D_right", "R_right"},
               raw.Word({"model"}), file.pairs, out);
  return out;
}

Calibration FromVins(const CalibrationDocument& file) {
  if (file["model_type"].IsDefined()) return OneCamera(file, "VINS");
  const auto read = [&](const char* key) {
    const std::string name = file.Word({key});
    const fs::path beside = file.file().parent_path() / name;
    Calibration out =
        OneCamera(ParseCalibration(beside, ReadCalibrationText(beside), false), "VINS, " + name);
    CheckCalibrated(beside, out.camera);
    return out;
  };
  Calibration out = read("cam0_calib");
  constexpr double kUnknown = 2;  // estimate_extrinsic: what is given means nothing
  if (file.Number({"estimate_extrinsic"}).value_or(0) != kUnknown)
    TakeImu(file, "", "body_T_cam0", "td", out);
  const KeyValue left = file.Find({"body_T_cam0"}), right = file.Find({"body_T_cam1"});
  if (file.pairs && left && right && file["cam1_calib"].IsDefined())
    SetRight(file, read("cam1_calib").camera, file.Transform(right).Inverse() * file.Transform(left), out);
  return out;
}

Calibration FromBasalt(const CalibrationDocument& file) {
  const YAML::Node value = file["value0"];
  // Element i of a list.
  const auto element = [&](const char* name, std::size_t i) {
    const YAML::Node list = value[name];
    if (!list.IsDefined() || !list.IsSequence() || i >= list.size())
      file.Fail(value, std::string("value0 has no '") + name + "' of camera " + std::to_string(i));
    return list[i];
  };
  const auto camera = [&](std::size_t i) {
    Calibration out = OneCamera(file.At(element("intrinsics", i)), "Basalt");
    const auto size = file.Array<2>({element("resolution", i), "resolution"});
    SetPixels(size[0], size[1], out.camera);
    return out;
  };
  Calibration out = camera(0);
  const std::size_t count = value["intrinsics"].size();
  if (count > 1) out.format += ", the first of " + std::to_string(count) + " cameras";
  if (const YAML::Node list = value["T_imu_cam"]; list.IsDefined() && list.IsSequence() && list.size() > 0)
    out.T_camera_imu = RowsOf(PoseOfBasalt(file.At(list[0])).Inverse());
  out.imu_offset_s = -1e-9 * file.At(value).Number({"cam_time_offset_ns"}).value_or(0);
  if (file.pairs && count > 1) {
    const Pose left = PoseOfBasalt(file.At(element("T_imu_cam", 0)));
    const Pose right = PoseOfBasalt(file.At(element("T_imu_cam", 1)));
    SetRight(file, camera(1).camera, right.Inverse() * left, out);
  }
  return out;
}

}  // namespace tutti
