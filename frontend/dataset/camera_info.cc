#include "frontend/dataset/camera_info.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>

#include "core/camera_text.h"
#include "frontend/dataset/image_file.h"
#include "frontend/dataset/rectified_rig.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

Eigen::Matrix3d Rotation(const std::array<double, 9>& rows) {
  Eigen::Matrix3d R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= 0.01 &&
        R.determinant() > 0))  // also if it is not finite
    throw InputError("is no rotation");
  return R;
}

}  // namespace

bool ImageWindow::IsWhole() const {
  return binning_x <= 1 && binning_y <= 1 && x_offset == 0 && y_offset == 0 && (width == 0 || height == 0);
}

std::string ImageWindow::Text() const {
  std::string text;
  if (binning_x > 1 || binning_y > 1)
    text = "binning " + SizeText({std::max(1, binning_x), std::max(1, binning_y)});
  if (width > 0 && height > 0)
    text += (text.empty() ? "region " : ", region ") + SizeText({width, height}) + " at (" +
            std::to_string(x_offset) + ", " + std::to_string(y_offset) + ")";
  return text;
}

PinholeCamera Windowed(PinholeCamera camera, const ImageWindow& window, const std::string& source) {
  if (window.IsWhole()) return camera;
  const bool region = window.width > 0 && window.height > 0;
  const int bin_x = std::max(1, window.binning_x), bin_y = std::max(1, window.binning_y);
  const bool sized = camera.width > 0 && camera.height > 0;
  const auto outside = [&](int offset, int size, int whole) {
    return offset < 0 || size < 0 || (sized && (offset > whole || size > whole - offset));
  };
  if (outside(window.x_offset, region ? window.width : 0, camera.width) ||
      outside(window.y_offset, region ? window.height : 0, camera.height) ||
      (sized && (bin_x > camera.width || bin_y > camera.height)))
    throw InputError(source + ": the part of the image (" + window.Text() + ") does not lie in the " +
                     SizeText({camera.width, camera.height}) +
                     " pixels of the calibration; width and height are those of whole, unbinned images "
                     "(REP 104)");
  camera.width = (region ? window.width : camera.width) / bin_x;
  camera.height = (region ? window.height : camera.height) / bin_y;
  camera.fx /= bin_x;
  camera.fy /= bin_y;
  camera.cx = (camera.cx - window.x_offset + 0.5) / bin_x - 0.5;
  camera.cy = (camera.cy - window.y_offset + 0.5) / bin_y - 0.5;
  return camera;
}

PinholeCamera CameraInfo::Raw(const std::string& source) const {
  PinholeCamera camera = Pinhole(K[0], K[4], K[2], K[5], {width, height});
  const std::string wrong = internal::SetLens(model, lens, camera);
  if (!wrong.empty()) throw InputError(source + ": " + wrong);
  return camera;
}

PinholeCamera CameraInfo::Rectified() const { return Pinhole(P[0], P[5], P[2], P[6], {width, height}); }

Pose TransformOfRectified(const std::array<double, 9>& R_left, const std::array<double, 9>& R_right,
                          double baseline_m) {
  const Eigen::Matrix3d left = Rotation(R_left), right = Rotation(R_right);
  return {Eigen::Quaterniond(right.transpose() * left).normalized(),
          right.transpose() * Eigen::Vector3d(-baseline_m, 0, 0)};
}

}  // namespace tutti
