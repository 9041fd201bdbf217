// The calibration of KITTI raw: calib_cam_to_cam.txt and what lies beside it.
#include <algorithm>
#include <cmath>
#include <map>

#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/layout.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

using Matrix34 = Eigen::Matrix<double, 3, 4>;

// "P_rect_00:" -> its numbers.
using Entries = std::map<std::string, std::vector<double>>;

Entries ReadEntries(const fs::path& file) {
  Entries entries;
  for (const TextLine& line : ReadTextLines(file)) {
    std::vector<double>& values = entries[line.words.front()];
    values.clear();
    for (std::size_t i = 1; i < line.words.size(); ++i) {
      const std::optional<double> value = ParseDouble(line.words[i]);
      if (value && std::isfinite(*value)) values.push_back(*value);  // calib_time: a date
    }
  }
  return entries;
}

const std::vector<double>& Entry(const fs::path& file, const Entries& entries, const std::string& key,
                                 std::size_t count) {
  const auto found = entries.find(key);
  if (found == entries.end() || found->second.size() < count)
    throw InputError(file.string() + ": has no line '" + key + "' with " + std::to_string(count) +
                     " numbers");
  return found->second;
}

Pose RigidEntry(const fs::path& file, const Entries& entries, const std::string& rotation,
                const std::string& translation) {
  const std::vector<double>& r = Entry(file, entries, rotation, 9);
  Matrix34 m = Matrix34::Zero();
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = r[static_cast<std::size_t>(i)];
  if (!translation.empty()) {
    const std::vector<double>& t = Entry(file, entries, translation, 3);
    for (int i = 0; i < 3; ++i) m(i, 3) = t[static_cast<std::size_t>(i)];
  }
  if (!(std::abs(m.leftCols<3>().determinant() - 1) <= 0.01))
    throw InputError(file.string() + ": '" + rotation + "' is not a rotation");
  return Pose::FromMatrix(m);
}

// KITTI raw (Geiger et al., IJRR 2013): rectified ("sync") or raw ("extract") images of camera 0 and 1, or 2
// and 3; calibrations of a day in the folder above its drives.
class KittiRaw {
 public:
  KittiRaw(const fs::path& folder, const FoundLayout& found, cv::Size size)
      : grey_(std::string(found.layout->left.folder).find("00") != std::string::npos) {
    std::error_code ignored;
    const fs::path above = fs::absolute(folder, ignored).lexically_normal() / "";
    for (const fs::path& place : {above.parent_path(), above.parent_path().parent_path()}) {
      if (!fs::is_regular_file(place / "calib_cam_to_cam.txt", ignored)) continue;
      place_ = place;
      cameras_file_ = place / "calib_cam_to_cam.txt";
      cameras_ = ReadEntries(cameras_file_);
      break;
    }
    if (cameras_file_.empty()) {
      out_.notes.push_back(folder.string() +
                           ": calib_cam_to_cam.txt is neither here nor in the folder above; copy the day's "
                           "calibration (2011_09_26_calib.zip and its like) there");
      return;
    }
    out_.source = "calib_cam_to_cam.txt";
    const std::string left = grey_ ? "00" : "02", right = grey_ ? "01" : "03";
    const std::vector<double>& stored = Entry(cameras_file_, cameras_, "S_" + left + ":", 2);
    const std::vector<double>& rectified = Entry(cameras_file_, cameras_, "S_rect_" + left + ":", 2);
    if (size == SizeOf(stored) && SizeOf(stored) != SizeOf(rectified))
      Raw(left, right);
    else
      Rectified(left, right);
  }
  LayoutCalibration Take() { return std::move(out_); }

 private:
  static cv::Size SizeOf(const std::vector<double>& s) {
    return {static_cast<int>(std::clamp(s[0], 0.0, 1e5)), static_cast<int>(std::clamp(s[1], 0.0, 1e5))};
  }
  Matrix34 Projection(const std::string& camera) const {
    const std::vector<double>& v = Entry(cameras_file_, cameras_, "P_rect_" + camera + ":", 12);
    Matrix34 p = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(v.data());
    if (!(p(0, 0) > 0 && p(1, 1) > 0))
      throw InputError(cameras_file_.string() + ": the focal lengths of P_rect_" + camera +
                       " must be positive");
    return p;
  }
  void Rectified(const std::string& left, const std::string& right) {
    const Matrix34 p = Projection(left);
    PinholeCamera& camera = out_.rig.left.emplace();
    camera.fx = p(0, 0), camera.fy = p(1, 1), camera.cx = p(0, 2), camera.cy = p(1, 2);
    const Eigen::Vector3d at = PositionOfCamera(p);
    if (cameras_.count("P_rect_" + right + ":") > 0)
      out_.rig.baseline_m = PositionOfCamera(Projection(right)).x() - at.x();
    const Pose rectifying = RigidEntry(cameras_file_, cameras_, "R_rect_00:", "");
    SetBody(rectifying, Pose(Eigen::Quaterniond::Identity(), at));
  }
  PinholeCamera Lens(const std::string& camera) const {
    const std::vector<double>& k = Entry(cameras_file_, cameras_, "K_" + camera + ":", 9);
    const std::vector<double>& d = Entry(cameras_file_, cameras_, "D_" + camera + ":", 5);
    PinholeCamera lens;
    lens.fx = k[0], lens.fy = k[4], lens.cx = k[2], lens.cy = k[5];
    lens.distortion = Distortion::kRadTan;
    for (std::size_t i = 0; i < 5; ++i) lens.coefficients[i] = d[i];
    return lens;
  }
  void Raw(const std::string& left, const std::string& right) {
    out_.rig.left = Lens(left);
    const Pose T_left_0 = RigidEntry(cameras_file_, cameras_, "R_" + left + ":", "T_" + left + ":");
    if (cameras_.count("K_" + right + ":") > 0) {
      out_.rig.right = Lens(right);
      out_.rig.T_right_left =
          RigidEntry(cameras_file_, cameras_, "R_" + right + ":", "T_" + right + ":") * T_left_0.Inverse();
    }
    SetBody(Pose(), T_left_0.Inverse());
  }
  // The body of oxts is the IMU.
  void SetBody(const Pose& T_camera_0, const Pose& T_camera_left) {
    std::error_code ignored;
    const fs::path imu = place_ / "calib_imu_to_velo.txt", laser = place_ / "calib_velo_to_cam.txt";
    if (!fs::is_regular_file(imu, ignored) || !fs::is_regular_file(laser, ignored)) {
      out_.notes.push_back(place_.string() +
                           ": calib_imu_to_velo.txt or calib_velo_to_cam.txt is missing; the ground truth is "
                           "that of the IMU, about a metre from the camera and of other axes");
      return;
    }
    const Pose T_0_imu =
        RigidEntry(laser, ReadEntries(laser), "R:", "T:") * RigidEntry(imu, ReadEntries(imu), "R:", "T:");
    out_.rig.T_body_left = (T_camera_0 * T_0_imu).Inverse() * T_camera_left;
  }

  bool grey_;
  fs::path place_, cameras_file_;
  Entries cameras_;
  LayoutCalibration out_;
};

}  // namespace

LayoutCalibration ReadKittiRawCalibration(const fs::path& folder, const FoundLayout& found, cv::Size size) {
  return KittiRaw(folder, found, size).Take();
}

}  // namespace tutti
