// Poses, trajectories and images as numpy arrays, and back; images without copies where that can be.
#pragma once

#include <pybind11/numpy.h>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "tutti/core/pose.h"
#include "tutti/core/trajectory.h"

namespace tutti::python {

/// The rows of an array of numbers that can be cast to float64. Raises TypeError, or ValueError if it has not
/// two dimensions and one of these numbers of columns (none given: any).
pybind11::array_t<double> RowsOf(const pybind11::object& array, const std::string& name,
                                 const std::vector<pybind11::ssize_t>& columns);

/// x, y, z, qx, qy, qz, qw (and scale), or a matrix of 4 x 4 or 3 x 4, whose 3 x 3 part is a rotation times a
/// scale. Throws InputError where that is none.
Similarity SimilarityOf(const pybind11::object& array, const std::string& name);
/// A similarity whose scale is 1. Throws InputError where that is none.
Pose PoseOf(const pybind11::object& array, const std::string& name);
/// A square matrix of N x N.
Eigen::MatrixXd MatrixOf(const pybind11::object& array, const std::string& name, int size);

/// (4, 4), of float64.
pybind11::array_t<double> ArrayOf(const Pose& pose);
/// (4, 4); the 3 x 3 part is the rotation times the scale.
pybind11::array_t<double> ArrayOf(const Similarity& similarity);
/// (N, 7): x, y, z, qx, qy, qz, qw.
pybind11::array_t<double> ArrayOf(const std::vector<Pose>& poses);
/// (N, 8): stamp, x, y, z, qx, qy, qz, qw.
pybind11::array_t<double> ArrayOf(const Trajectory& trajectory);
/// Any matrix of Eigen.
pybind11::array_t<double> ArrayOf(const Eigen::MatrixXd& matrix);

/// From (N, 8). Quaternions of 0, if all are, are positions alone. Throws InputError that names the row for a
/// stamp that does not grow, and for what is no pose.
Trajectory TrajectoryOf(const pybind11::object& array, const std::string& name);

/// The pixels of an array, and what keeps them.
struct ImageView {
  cv::Mat pixels;         ///< empty for None; those of the array itself where each of its rows is contiguous
  pybind11::array owner;  ///< `pixels` are good as long as it lives
};

/// uint8 or uint16 of shape (H, W), or uint8 (H, W, 3), whose channels are as OpenCV has them (blue first)
/// unless `rgb`. Raises TypeError or ValueError, which call the array `name`.
ImageView ViewOfImage(const pybind11::object& array, const char* name, bool rgb = false);
/// float32 or float64 (H, W), metres.
ImageView ViewOfDepth(const pybind11::object& array, const char* name);
/// uint8 or bool (H, W).
ImageView ViewOfMask(const pybind11::object& array, const char* name);
/// One descriptor a row: uint8 or float32 (N, D). Owns its numbers.
cv::Mat DescriptorsOf(const pybind11::object& array, const char* name);

/// A read-only array on the pixels, which it keeps; None if there are none.
pybind11::object ArrayOfImage(const cv::Mat& image);

}  // namespace tutti::python
