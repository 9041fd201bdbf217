// tutti.DenseMap: meshes, clouds and grids from depth images with poses.
#include "tutti/dense/dense_map.h"

#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <optional>

#include "apps/python/arrays.h"
#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "tutti/core/error.h"
#include "tutti/dense/dense_files.h"

namespace tutti::python {
namespace {

// (N, 3), one row for each of the vectors.
template <class Number, class Rows>
py::array_t<Number> RowsOfThree(const Rows& rows) {
  py::array_t<Number> array({static_cast<py::ssize_t>(rows.size()), py::ssize_t{3}});
  Number* to = array.mutable_data();
  for (const auto& row : rows) {
    for (std::size_t i = 0; i < 3; ++i) *to++ = row[static_cast<decltype(rows.front().size())>(i)];
  }
  return array;
}

py::array_t<std::int8_t> CellsOf(const OccupancyGrid& grid) {
  py::array_t<std::int8_t> array({py::ssize_t{grid.cells.rows}, py::ssize_t{grid.cells.cols}});
  for (int y = 0; y < grid.cells.rows; ++y)
    for (int x = 0; x < grid.cells.cols; ++x) array.mutable_at(y, x) = grid.cells.at<std::int8_t>(y, x);
  return array;
}

std::unique_ptr<Guarded<DenseMap>> NewDenseMap(double voxel_m, double max_depth_m, int min_frames,
                                               bool free_space, double cell_m, int memory_mb, int threads) {
  DenseOptions options;
  options.voxel_m = voxel_m;
  options.max_depth_m = max_depth_m;
  options.min_frames = min_frames;
  options.free_space = free_space;
  options.cell_m = cell_m;
  options.memory_mb = memory_mb;
  options.threads = threads;
  return std::make_unique<Guarded<DenseMap>>(DenseMap(options));
}

std::optional<std::string> Integrate(Guarded<DenseMap>& map, const py::object& depth, const py::object& image,
                                     const py::object& T_world_camera, const PinholeCamera& camera,
                                     bool rgb) {
  const ImageView metres = ViewOfDepth(depth, "depth"), colours = ViewOfImage(image, "image", rgb);
  const Pose pose = PoseOf(T_world_camera, "T_world_camera");
  std::string problem = map.Run([&](DenseMap& m) {
    cv::Mat floats;
    metres.pixels.convertTo(floats, CV_32F);
    return m.Integrate(floats, colours.pixels, pose, camera);
  });
  if (problem.empty()) return std::nullopt;
  return problem;
}

std::string DescribeOptions() {
  std::string text = std::string(doc::DenseMap) + "\n\nKeywords:\n";
  const DenseOptions options;
  ForEachOption(options, [&](const OptionText& option, const auto& /*field*/) {
    text.append(option.name).append(": ").append(option.sentence);
    text.append(*option.unit == '\0' ? "" : " [" + std::string(option.unit) + "]").append("\n");
  });
  return text;
}

void WriteSurface(const std::filesystem::path& file, const py::object& surface) {
  if (py::isinstance<TriangleMesh>(surface)) {
    const auto& mesh = surface.cast<const TriangleMesh&>();
    Writing([&] { WritePly(file, mesh); });
  } else if (py::isinstance<PointCloud>(surface)) {
    const auto& cloud = surface.cast<const PointCloud&>();
    Writing([&] { WritePly(file, cloud); });
  } else {
    throw py::type_error("surface must be a TriangleMesh or a PointCloud");
  }
}

}  // namespace

void BindDenseMap(py::module_& module) {
  py::class_<PointCloud>(module, "PointCloud", doc::PointCloud)
      .def_property_readonly(
          "points", [](const PointCloud& cloud) { return RowsOfThree<float>(cloud.points); },
          doc::PointCloud_points)
      .def_property_readonly(
          "normals", [](const PointCloud& cloud) { return RowsOfThree<float>(cloud.normals); },
          doc::PointCloud_normals)
      .def_property_readonly(
          "colours", [](const PointCloud& cloud) { return RowsOfThree<std::uint8_t>(cloud.colours); },
          doc::PointCloud_colours);
  py::class_<TriangleMesh>(module, "TriangleMesh", doc::TriangleMesh)
      .def_property_readonly(
          "vertices", [](const TriangleMesh& mesh) { return mesh.vertices; },
          "points of the corners (PointCloud)")
      .def_property_readonly(
          "triangles", [](const TriangleMesh& mesh) { return RowsOfThree<std::uint32_t>(mesh.triangles); },
          doc::TriangleMesh_triangles);
  py::class_<OccupancyGrid>(module, "OccupancyGrid", doc::OccupancyGrid)
      .def_property_readonly("cells", &CellsOf, doc::OccupancyGrid_cells)
      .def_readonly("cell_m", &OccupancyGrid::cell_m, "edge of a cell [m]")
      .def_property_readonly(
          "origin",
          [](const OccupancyGrid& grid) { return py::make_tuple(grid.origin.x(), grid.origin.y()); },
          doc::OccupancyGrid_origin)
      .def_property_readonly(
          "T_map_world", [](const OccupancyGrid& grid) { return ArrayOf(grid.T_map_world); },
          "from the world of the poses to the map, 4 x 4");
  const DenseOptions d;
  py::class_<Guarded<DenseMap>>(module, "DenseMap", DescribeOptions().c_str())
      .def(py::init(&NewDenseMap), py::kw_only(), py::arg("voxel_m") = d.voxel_m,
           py::arg("max_depth_m") = d.max_depth_m, py::arg("min_frames") = d.min_frames,
           py::arg("free_space") = d.free_space, py::arg("cell_m") = d.cell_m,
           py::arg("memory_mb") = d.memory_mb, py::arg("threads") = d.threads)
      .def("integrate", &Integrate, py::arg("depth"), py::arg("image"), py::arg("T_world_camera"),
           py::arg("camera"), py::arg("rgb") = false,
           "Adds a depth image: (H, W) of float [m]; 0 and not finite: no measurement. `image`: uint8 (H, W, "
           "3), blue "
           "first unless `rgb`, (H, W), or None. Returns None, or why the frame was skipped.")
      .def("mesh", Locked(&DenseMap::Mesh), doc::DenseMap_Mesh)
      .def("cloud", Locked(&DenseMap::Cloud), doc::DenseMap_Cloud)
      .def(
          "grid",
          [](Guarded<DenseMap>& map, double low_m, double high_m) {
            return map.Run([&](const DenseMap& m) { return GridOf(m.Space(), low_m, high_m); });
          },
          py::arg("low_m") = 0.1, py::arg("high_m") = 1.0, doc::GridOf)
      .def_property_readonly(
          "memory_mb",
          [](Guarded<DenseMap>& map) { return map.Run([](DenseMap& m) { return m.Report().memory_mb; }); },
          doc::DenseReport_memory_mb);
  module.def("write_ply", &WriteSurface, py::arg("file"), py::arg("surface"), doc::WritePly);
  module.def(
      "write_grid",
      [](const std::filesystem::path& folder, const OccupancyGrid& grid) {
        Writing([&] { WriteGrid(folder, grid); });
      },
      py::arg("folder"), py::arg("grid"), doc::WriteGrid);
}

}  // namespace tutti::python
