// Keys of calibration files in YAML or JSON, and the one camera that they describe. Internal.
#pragma once

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "frontend/dataset/camera_info.h"
#include "tutti/core/camera.h"

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
  /// Of lists, lists of lists, texts of numbers, and matrices of OpenCV and ROS ({rows, cols, data}), row by
  /// row.
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

/// The same with matrices of these names, for files with two cameras. `lens`: its name.
PinholeCamera CameraOfMatrices(const CalibrationKeys& keys, const char* matrix, const char* coefficients,
                               const std::string& lens, std::string* note);

/// A calibration file of keys.
struct CalibrationDocument {
  CalibrationKeys root;
  std::string text;
  bool pairs = false;  ///< the right camera is wanted, too

  /// A key of the root; it may be undefined.
  YAML::Node operator[](const char* key) const {
    const YAML::Node& map = root.map();
    return map[key];
  }
  CalibrationKeys At(const YAML::Node& map, const std::string& prefix = "") const {
    return root.At(map, prefix);
  }
  bool IsCamera(const YAML::Node& node) const {
    return node.IsDefined() && node.IsMap() && HoldsCamera(At(node));
  }
};

/// The text of a calibration file, as a YAML parser takes it: without what OpenCV's has beside.
std::string ReadCalibrationText(const std::filesystem::path& file);
/// That text as keys; throws InputError if it is neither YAML nor JSON.
CalibrationDocument ParseCalibration(const std::filesystem::path& file, const std::string& text, bool pairs);

}  // namespace tutti
