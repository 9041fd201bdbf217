// The calibration of KITTI raw (Geiger et al., IJRR 2013): rectified ("sync") or raw ("extract") images of
// camera 0 and 1, or 2 and 3; calib_cam_to_cam.txt of a day and what lies beside it stand in the folder above
// its drives.
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

/// A file of lines such as "P_rect_00: 7.2e+02 0 ...". Methods throw InputError for what it has not.
class KittiCalibration {
 public:
  explicit KittiCalibration(fs::path file) : file_(std::move(file)) {
    for (const TextLine& line : ReadTextLines(file_)) {
      std::vector<double>& values = entries_[line.words.front()];
      values.clear();
      for (std::size_t i = 1; i < line.words.size(); ++i) {
        const std::optional<double> value = ParseDouble(line.words[i]);
        if (value && std::isfinite(*value)) values.push_back(*value);  // calib_time: a date
      }
    }
  }

  bool Has(const std::string& key) const { return entries_.count(key) > 0; }
  const std::vector<double>& Numbers(const std::string& key, std::size_t count) const {
    const auto found = entries_.find(key);
    if (found == entries_.end() || found->second.size() < count)
      throw InputError(file_.string() + ": has no line '" + key + "' with " + std::to_string(count) +
                       " numbers");
    return found->second;
  }
  cv::Size Size(const std::string& key) const {
    const std::vector<double>& s = Numbers(key, 2);
    return {static_cast<int>(std::clamp(s[0], 0.0, 1e5)), static_cast<int>(std::clamp(s[1], 0.0, 1e5))};
  }
  /// `translation` may be empty: zero.
  Pose Rigid(const std::string& rotation, const std::string& translation) const {
    const std::vector<double>& r = Numbers(rotation, 9);
    Matrix34 m = Matrix34::Zero();
    for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = r[static_cast<std::size_t>(i)];
    if (!translation.empty()) m.col(3) = Eigen::Map<const Eigen::Vector3d>(Numbers(translation, 3).data());
    if (!(std::abs(m.leftCols<3>().determinant() - 1) <= 0.01))
      throw InputError(file_.string() + ": '" + rotation + "' is not a rotation");
    return Pose::FromMatrix(m);
  }
  Matrix34 Projection(const std::string& camera) const {
    const std::vector<double>& v = Numbers("P_rect_" + camera + ":", 12);
    Matrix34 p = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(v.data());
    if (!(p(0, 0) > 0 && p(1, 1) > 0))
      throw InputError(file_.string() + ": the focal lengths of P_rect_" + camera + " must be positive");
    return p;
  }
  PinholeCamera Raw(const std::string& camera) const {
    const std::vector<double>& k = Numbers("K_" + camera + ":", 9);
    const std::vector<double>& d = Numbers("D_" + camera + ":", 5);
    PinholeCamera lens = Pinhole(k[0], k[4], k[2], k[5]);
    lens.distortion = Distortion::kRadTan;
    std::copy_n(d.begin(), 5, lens.coefficients.begin());
    return lens;
  }

 private:
  fs::path file_;
  std::map<std::string, std::vector<double>> entries_;
};

// The body of oxts is the IMU. Points of camera 0 and of the calibrated left camera go into the same axes.
void SetBody(const fs::path& place, const Pose& T_axes_0, const Pose& T_axes_left, LayoutCalibration& out) {
  std::error_code ignored;
  const fs::path imu = place / "calib_imu_to_velo.txt", laser = place / "calib_velo_to_cam.txt";
  if (!fs::is_regular_file(imu, ignored) || !fs::is_regular_file(laser, ignored)) {
    out.notes.push_back(place.string() +
                        ": calib_imu_to_velo.txt or calib_velo_to_cam.txt is missing; the ground truth is "
                        "that of the IMU, about a metre from the camera and of other axes");
    return;
  }
  const Pose T_0_imu = KittiCalibration(laser).Rigid("R:", "T:") * KittiCalibration(imu).Rigid("R:", "T:");
  out.rig.T_body_left = (T_axes_0 * T_0_imu).Inverse() * T_axes_left;
}

}  // namespace

LayoutCalibration ReadKittiRawCalibration(const fs::path& folder, const FoundLayout& found, cv::Size size) {
  LayoutCalibration out;
  std::error_code ignored;
  fs::path place = (fs::absolute(folder, ignored).lexically_normal() / "").parent_path();
  if (!fs::is_regular_file(place / "calib_cam_to_cam.txt", ignored)) place = place.parent_path();
  if (!fs::is_regular_file(place / "calib_cam_to_cam.txt", ignored)) {
    out.notes.push_back(folder.string() +
                        ": calib_cam_to_cam.txt is neither here nor in the folder above; copy the day's "
                        "calibration (2011_09_26_calib.zip and its like) there");
    return out;
  }
  out.source = "calib_cam_to_cam.txt";
  const KittiCalibration cameras(place / out.source);
  const bool grey = std::string(found.layout->left.folder).find("00") != std::string::npos;
  const std::string left = grey ? "00" : "02", right = grey ? "01" : "03";
  const cv::Size stored = cameras.Size("S_" + left + ":"), rectified = cameras.Size("S_rect_" + left + ":");
  if (size == stored && stored != rectified) {
    out.rig.left = cameras.Raw(left);
    const Pose T_0_left = cameras.Rigid("R_" + left + ":", "T_" + left + ":").Inverse();
    if (cameras.Has("K_" + right + ":")) {
      out.rig.right = cameras.Raw(right);
      out.rig.T_right_left = cameras.Rigid("R_" + right + ":", "T_" + right + ":") * T_0_left;
    }
    SetBody(place, Pose(), T_0_left, out);
    return out;
  }
  const Matrix34 p = cameras.Projection(left);
  out.rig.left = Pinhole(p(0, 0), p(1, 1), p(0, 2), p(1, 2));
  const Eigen::Vector3d at = PositionOfCamera(p);
  if (cameras.Has("P_rect_" + right + ":"))
    out.rig.baseline_m = PositionOfCamera(cameras.Projection(right)).x() - at.x();
  SetBody(place, cameras.Rigid("R_rect_00:", ""), Pose(Eigen::Quaterniond::Identity(), at), out);
  return out;
}

}  // namespace tutti
