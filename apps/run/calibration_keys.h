// Keys of calibration files in YAML or JSON, the one camera that they describe, and the readers of the
// formats of SLAM and odometry programs. Internal.
#pragma once

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "apps/run/calibration_file.h"
#include "frontend/dataset/camera_info.h"

namespace tutti {

/// Names that programs give the same value; the first that is there counts.
using KeyNames = std::initializer_list<const char*>;

/// A value, and its key as the file spells it.
struct KeyValue {
  YAML::Node node;
  std::string key;
  explicit operator bool() const { return node.IsDefined(); }
};

/// The keys of one camera, in one or several places of a file: maps, or keys of a map that begin alike
/// ("Camera1."). All but Find and Has throw InputError that names file, line and key.
class CalibrationKeys {
 public:
  CalibrationKeys(std::filesystem::path file, const YAML::Node& map, const std::string& prefix = "");
  /// These, and where they have no value, those of another place; nothing is added for what is no map.
  CalibrationKeys Or(const YAML::Node& map, const std::string& prefix = "") const;
  /// Another place of the same file.
  CalibrationKeys At(const YAML::Node& map, const std::string& prefix = "") const;

  KeyValue Find(KeyNames names) const;
  bool Has(const char* name) const { return static_cast<bool>(Find({name})); }
  /// A word, as it stands there; empty if there is none.
  std::string Word(KeyNames names) const;
  /// 1, true, yes.
  bool IsTrue(KeyNames names) const;
  std::optional<double> Number(KeyNames names) const;
  double Needed(KeyNames names) const;
  /// Reads lists, lists of lists, texts of numbers, and matrices of OpenCV and ROS ({rows, cols, data}), row
  /// by row.
  std::vector<double> Numbers(const KeyValue& value) const;
  template <std::size_t kSize>
  std::array<double, kSize> Array(const KeyValue& value) const {
    const std::vector<double> values = Numbers(value);
    if (values.size() != kSize) FailSize(value, values.size(), std::to_string(kSize) + " are needed");
    std::array<double, kSize> out;
    std::copy(values.begin(), values.end(), out.begin());
    return out;
  }
  /// A 4x4 matrix, or its first three rows.
  Pose Transform(const KeyValue& value) const;

  const std::filesystem::path& file() const { return file_; }
  const YAML::Node& map() const { return places_.front().map; }
  [[noreturn]] void Fail(const YAML::Node& at, const std::string& what) const;
  [[noreturn]] void FailSize(const KeyValue& value, std::size_t size, const std::string& needed) const;

 private:
  struct Place {
    YAML::Node map;
    std::string prefix;
  };
  std::filesystem::path file_;
  std::vector<Place> places_;
};

/// True if these keys hold a focal length and a principal point, however written.
bool HoldsCamera(const CalibrationKeys& keys);

/// fx, fy, cx, cy of a matrix of 3x3, 3x4 or 4x4 values, by rows or by columns.
PinholeCamera CameraOfMatrix(const CalibrationKeys& keys, const KeyValue& matrix);

/// Which lens the words of a camera say; empty: none.
std::string LensName(const CalibrationKeys& keys);

/// The camera of these keys: intrinsics as scalars, list or matrix; size; lens; binning and region of
/// interest. `note`: what was assumed, for a message.
PinholeCamera CameraOfKeys(const CalibrationKeys& keys, std::string* note);

/// Reads matrices of these names, in files with two cameras. `lens`: its name.
PinholeCamera CameraOfMatrices(const CalibrationKeys& keys, const char* matrix, const char* coefficients,
                               const std::string& lens, std::string* note);

/// A calibration file of keys.
struct CalibrationDocument : CalibrationKeys {
  std::string text;
  bool pairs = false;  ///< the right camera is wanted, too

  /// A key of the file; it may be undefined.
  YAML::Node operator[](const char* key) const {
    const YAML::Node& root = map();
    return root[key];
  }
  bool IsCamera(const YAML::Node& node) const {
    return node.IsDefined() && node.IsMap() && HoldsCamera(At(node));
  }
};

/// The text of a calibration file, as a YAML parser takes it: without what OpenCV's has beside.
std::string ReadCalibrationText(const std::filesystem::path& file);
/// That text as keys; throws InputError if it is neither YAML nor JSON.
CalibrationDocument ParseCalibration(const std::filesystem::path& file, const std::string& text, bool pairs);

/// For messages.
constexpr const char* kKnownCalibrations =
    "the formats that are known are those of Kalibr, ORB-SLAM, OpenVSLAM and stella_vslam, VINS, Basalt, "
    "OpenCV, ROS (camera_info), EuRoC, KITTI, COLMAP (cameras.txt), nerfstudio (transforms.json), Open3D, "
    "RealSense, DSO, tutti (camera: fx), and a line of fx fy cx cy";

/// The camera of these keys, its frame rate and its depth scale. `format` is for messages.
Calibration OneCamera(const CalibrationKeys& keys, const std::string& format);

/// Adds the right camera of raw pairs. Throws InputError for a distance that can't be in metres.
void SetRight(const CalibrationKeys& keys, const PinholeCamera& right, const Pose& T_right_left,
              Calibration& out);

/// Throws InputError for a camera that no image can have; `which`: "right ", or "".
void CheckCalibrated(const std::filesystem::path& file, PinholeCamera camera, const char* which = "");

/// cam0, cam1, ... of Kalibr's camchain and of OpenVINS, as far as they are cameras.
std::vector<std::string> CamerasOfChain(const CalibrationDocument& file);

/// Each throws InputError that names file, line and key for what is missing, and for a lens that tutti hasn't
/// got. @{
Calibration FromChain(const CalibrationDocument& file);
Calibration FromOrbSlam(const CalibrationDocument& file);  ///< flat keys: ORB-SLAM2 and 3, OpenVSLAM
Calibration FromStella(const CalibrationDocument& file);   ///< stella_vslam's sections
Calibration FromVins(const CalibrationDocument& file);     ///< a camera, or the settings that name its file
Calibration FromBasalt(const CalibrationDocument& file);
/// @}

/// Calibrations as tables of words and numbers, not keys: reads COLMAP's cameras.txt, what
/// `rs-enumerate-devices -c` prints of one stream, DSO's camera.txt, a line "fx fy cx cy [k1 k2 p1 p2 [k3]]"
/// (ETH3D, DROID-SLAM), or a camera matrix of 3x3, 3x4 or 4x4 values (ScanNet, Stray Scanner). Nothing for
/// other texts. Throws InputError, which names file and line, for a camera that tutti has not.
std::optional<Calibration> ReadCalibrationTable(const std::filesystem::path& file, const std::string& text);

/// A camera without a lens, of any size.
PinholeCamera Intrinsics(double fx, double fy, double cx, double cy);
/// Sets the image's size, which files give as any numbers.
void SetPixels(double width, double height, PinholeCamera& camera);

}  // namespace tutti
