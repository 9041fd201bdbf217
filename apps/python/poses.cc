#include "apps/python/arrays.h"

#include <algorithm>
#include <cmath>

#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::python {
namespace {

namespace py = pybind11;

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

// Row of seven: x, y, z, qx, qy, qz, qw.
void WriteRow(const Pose& pose, double* row) {
  const Eigen::Vector4d& quaternion = pose.rotation.coeffs();
  row = std::copy_n(pose.translation.data(), 3, row);
  std::copy_n(quaternion.data(), 4, row);
}

// `unknown`: the rotation may be; see HasRotations.
Pose PoseOfRow(const double* row, const std::string& name, bool unknown = false) {
  const Eigen::Map<const Eigen::Vector3d> translation(row);
  const Eigen::Map<const Eigen::Vector4d> quaternion(row + 3);
  if (!translation.allFinite() || !quaternion.allFinite())
    throw InputError(name + ": a pose must have finite numbers");
  if (unknown && quaternion.isZero(0)) return Pose(Eigen::Quaterniond(0, 0, 0, 0), translation);
  if (quaternion.norm() < 1e-6) throw InputError(name + ": the quaternion has length 0");
  return Pose(Eigen::Quaterniond(quaternion).normalized(), translation);
}

Similarity SimilarityOfMatrix(const py::array_t<double>& array, const std::string& name) {
  Eigen::Matrix<double, 3, 4> matrix;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) matrix(row, column) = array.at(row, column);
  }
  const bool last_row = array.shape(0) == 3 || (array.at(3, 0) == 0 && array.at(3, 1) == 0 &&
                                                array.at(3, 2) == 0 && array.at(3, 3) == 1);
  const Eigen::Matrix3d part = matrix.leftCols<3>();
  const double determinant = part.determinant();
  if (!matrix.allFinite() || !last_row || !(determinant > 0))
    throw InputError(name + ": the matrix is no pose [sR t; 0 0 0 1]");
  double scale = std::cbrt(determinant);
  if ((part.transpose() * part / (scale * scale) - Eigen::Matrix3d::Identity()).norm() > 1e-3)
    throw InputError(name + ": the 3 x 3 part of the matrix is no rotation");
  if (std::abs(scale - 1) < 1e-6) scale = 1;  // digits that a file has left out
  matrix.leftCols<3>() /= scale;
  const Pose rigid = Pose::FromMatrix(matrix);
  return Similarity(scale, rigid.rotation, matrix.col(3));
}

Numbers NumbersOf(const py::object& object, const std::string& name) {
  if (!object.is_none()) {  // which numpy takes for a number that is none
    if (Numbers array = Numbers::ensure(object)) return array;
  }
  PyErr_Clear();
  throw py::type_error(name + " must be an array of numbers");
}

}  // namespace

py::array_t<double> RowsOf(const py::object& object, const std::string& name,
                           const std::vector<py::ssize_t>& columns) {
  const Numbers array = NumbersOf(object, name);
  const bool fits = array.ndim() == 2 && (columns.empty() || std::find(columns.begin(), columns.end(),
                                                                       array.shape(1)) != columns.end());
  if (!fits) {
    std::vector<std::string> words;
    words.reserve(columns.size());
    for (const py::ssize_t count : columns) words.push_back("(N, " + std::to_string(count) + ")");
    throw py::value_error(name + " must be of shape " +
                          (words.empty() ? "(N, columns)" : JoinText(words, " or ")) + ", not " +
                          py::str(array.attr("shape")).cast<std::string>());
  }
  return array;
}

Similarity SimilarityOf(const py::object& object, const std::string& name) {
  const Numbers array = NumbersOf(object, name);
  if (array.ndim() == 2 && (array.shape(0) == 3 || array.shape(0) == 4) && array.shape(1) == 4)
    return SimilarityOfMatrix(array, name);
  if (array.ndim() != 1 || (array.shape(0) != 7 && array.shape(0) != 8)) {
    throw py::value_error(
        name + " must be x, y, z, qx, qy, qz, qw (and scale), or a matrix of 4 x 4, not of shape " +
        py::str(array.attr("shape")).cast<std::string>());
  }
  Similarity similarity(PoseOfRow(array.data(), name));
  if (array.shape(0) == 8) similarity.scale = array.at(7);
  if (!(similarity.scale > 0) || !std::isfinite(similarity.scale))
    throw InputError(name + ": the scale must be above 0");
  return similarity;
}

Pose PoseOf(const py::object& array, const std::string& name) {
  const Similarity similarity = SimilarityOf(array, name);
  if (std::abs(similarity.scale - 1) > 1e-3) throw InputError(name + ": must be a pose without a scale");
  return similarity.RigidPart();
}

Eigen::MatrixXd MatrixOf(const py::object& object, const std::string& name, int size) {
  const py::array_t<double> array = RowsOf(object, name, {size});
  if (array.shape(0) != size)
    throw py::value_error(name + " must be a matrix of " + std::to_string(size) + " x " +
                          std::to_string(size));
  Eigen::MatrixXd matrix(size, size);
  for (int row = 0; row < size; ++row) {
    for (int column = 0; column < size; ++column) matrix(row, column) = array.at(row, column);
  }
  return matrix;
}

py::array_t<double> ArrayOf(const Eigen::MatrixXd& matrix) {
  py::array_t<double> array({matrix.rows(), matrix.cols()});
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column)
      array.mutable_at(row, column) = matrix(row, column);
  }
  return array;
}

py::array_t<double> ArrayOf(const Pose& pose) { return ArrayOf(Eigen::MatrixXd(pose.Matrix())); }

py::array_t<double> ArrayOf(const Similarity& similarity) {
  Eigen::Matrix4d matrix = similarity.RigidPart().Matrix();
  matrix.topLeftCorner<3, 3>() *= similarity.scale;
  return ArrayOf(Eigen::MatrixXd(matrix));
}

py::array_t<double> ArrayOf(const std::vector<Pose>& poses) {
  py::array_t<double> array({static_cast<py::ssize_t>(poses.size()), py::ssize_t{7}});
  double* row = array.mutable_data();
  for (const Pose& pose : poses) WriteRow(pose, row), row += 7;
  return array;
}

py::array_t<double> ArrayOf(const Trajectory& trajectory) {
  py::array_t<double> array({static_cast<py::ssize_t>(trajectory.size()), py::ssize_t{8}});
  double* row = array.mutable_data();
  for (const StampedPose& stamped : trajectory) {
    *row = stamped.stamp_s;
    WriteRow(stamped.pose, row + 1);
    row += 8;
  }
  return array;
}

Trajectory TrajectoryOf(const py::object& object, const std::string& name) {
  const py::array_t<double> array = RowsOf(object, name, {8});
  Trajectory trajectory(static_cast<std::size_t>(array.shape(0)));
  bool positions_alone = trajectory.size() > 1;
  for (std::size_t i = 0; i < trajectory.size(); ++i)
    positions_alone = positions_alone && Eigen::Map<const Eigen::Vector4d>(array.data(i) + 4).isZero(0);
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    const double* row = array.data(i);
    const std::string which = name + ", row " + std::to_string(i);
    trajectory[i] = {row[0], PoseOfRow(row + 1, which, positions_alone)};
    if (!std::isfinite(row[0])) throw InputError(which + ": the time stamp is not finite");
    if (i > 0 && row[0] <= trajectory[i - 1].stamp_s)
      throw InputError(which + ": time stamps must grow, but this one is not above the one before");
  }
  return trajectory;
}

}  // namespace tutti::python
