// Reading and writing of trajectories; poses as matrices and back.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <optional>

#include "apps/python/arrays.h"
#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "tutti/backend/trajectory_file.h"

namespace tutti::python {
namespace {

namespace fs = std::filesystem;

py::array_t<double> ReadRows(const fs::path& file, const std::optional<std::string>& format,
                             const std::vector<double>& times) {
  std::optional<PoseFileFormat> known;
  if (format) known = ParsePoseFileFormat(*format);
  const PoseFile read = Reading(file, [&] { return ReadPoseFile(file, known, times); });
  for (const std::string& warning : read.warnings) Warn(warning);
  return ArrayOf(read.trajectory);
}

void WriteRows(const fs::path& file, const py::object& rows, const std::string& format) {
  const Trajectory trajectory = TrajectoryOf(rows, "trajectory");
  const PoseFileFormat known = ParsePoseFileFormat(format);
  Writing([&] { WritePoseFile(file, trajectory, known); });
}

py::array_t<double> Matrices(const py::object& object) {
  const py::array_t<double> rows = RowsOf(object, "poses", {7, 8});
  const py::ssize_t first = rows.shape(1) - 7;  // a trajectory has stamps
  py::array_t<double> matrices({rows.shape(0), py::ssize_t{4}, py::ssize_t{4}});
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const py::array row(py::dtype::of<double>(), {7}, rows.data(i, first));
    const Eigen::Matrix4d matrix = PoseOf(row, "poses, row " + std::to_string(i)).Matrix();
    for (int k = 0; k < 16; ++k) matrices.mutable_at(i, k / 4, k % 4) = matrix(k / 4, k % 4);
  }
  return matrices;
}

py::array_t<double> PosesOfMatrices(const py::object& object) {
  const auto matrices = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object);
  if (!matrices) throw py::type_error("matrices must be an array of numbers");
  const bool fits =
      matrices.ndim() == 3 && (matrices.shape(1) == 3 || matrices.shape(1) == 4) && matrices.shape(2) == 4;
  if (!fits) throw py::value_error("matrices must be of shape (N, 4, 4) or (N, 3, 4)");
  std::vector<Pose> poses;
  for (py::ssize_t i = 0; i < matrices.shape(0); ++i)
    poses.push_back(PoseOf(matrices[py::int_(i)], "matrices, " + std::to_string(i)));
  return ArrayOf(poses);
}

}  // namespace

void BindTrajectories(py::module_& module) {
  module.def(
      "read_trajectory", &ReadRows, py::arg("file"), py::arg("format") = py::none(),
      py::arg("times") = std::vector<double>(),
      (std::string("Returns (N, 8) of float64: stamp [s], x, y, z [m], qx, qy, qz, qw (all 0: positions "
                   "alone); T_world_body. `format`: \"tum\", \"kitti\", \"euroc\", \"g2o\"; None: by the "
                   "content. `times`: stamps [s] of KITTI's lines (one each), or of g2o's ids.\n\n") +
       doc::ReadPoseFile)
          .c_str());
  module.def(
      "write_trajectory", &WriteRows, py::arg("file"), py::arg("trajectory"), py::arg("format") = "tum",
      (std::string("`trajectory`: (N, 8) as read_trajectory returns it.\n\n") + doc::WritePoseFile).c_str());
  module.def("pose_matrices", &Matrices, py::arg("poses"),
             "Poses (N, 7), or a trajectory (N, 8), as matrices (N, 4, 4).");
  module.def("poses_of_matrices", &PosesOfMatrices, py::arg("matrices"),
             "Matrices (N, 4, 4) or (N, 3, 4) as poses (N, 7): x, y, z, qx, qy, qz, qw.");
}

}  // namespace tutti::python
