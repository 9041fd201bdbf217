// Files of dense maps: PLY as Open3D and meshio read it, grids as map_server reads them.
#include "tutti/dense/dense_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/apps/dense/known_geometry.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/full_disk.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_room.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;
using testing::ReadAll;

TriangleMesh OneTriangle() {
  TriangleMesh mesh;
  mesh.vertices.points = {{0, 0, 1}, {0, 2, 1}, {3, 0, 1}};
  mesh.vertices.normals.assign(3, Eigen::Vector3f(0, 0, -1));
  mesh.vertices.colours = {{{255, 0, 10}}, {{0, 200, 20}}, {{1, 2, 3}}};
  mesh.triangles = {{{0, 1, 2}}};
  return mesh;
}

// What another program reads, or the reason why there is none.
std::string Read(const std::string& python, const std::filesystem::path& file) {
  const testing::ProcessResult said =
      testing::RunProgramAndSignal("/usr/bin/python3", {"-c", python, file.string()}, "", 0);
  return said.status == 77 || said.status == 127 ? "" : said.output;
}

constexpr const char* kOpen3d = R"(
import sys
try:
    import numpy, open3d
except ImportError:
    sys.exit(77)
mesh = open3d.io.read_triangle_mesh(sys.argv[1])
print(numpy.asarray(mesh.vertices).tolist(), numpy.asarray(mesh.triangles).tolist(),
      numpy.asarray(mesh.vertex_normals)[0].tolist(), numpy.rint(255 * numpy.asarray(mesh.vertex_colors)).astype(int).tolist())
)";

constexpr const char* kMeshio = R"(
import sys
try:
    import meshio
except ImportError:
    sys.exit(77)
mesh = meshio.read(sys.argv[1])
print(mesh.points.tolist(), [block.data.tolist() for block in mesh.cells], mesh.point_data["nz"].tolist())
)";

TEST(DenseFiles, AMeshIsReadByOpen3d) {
  const auto file = testing::FreshFolder() / "mesh.ply";
  WritePly(file, OneTriangle());
  const std::string said = Read(kOpen3d, file);
  if (said.empty()) GTEST_SKIP() << "there is no reader; apt-get install python3-open3d";
  EXPECT_THAT(said,
              HasSubstr("[[0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [3.0, 0.0, 1.0]] [[0, 1, 2]] [0.0, 0.0, -1.0] "
                        "[[255, 0, 10], [0, 200, 20], [1, 2, 3]]"));
}

TEST(DenseFiles, AMeshIsReadByMeshio) {
  const auto file = testing::FreshFolder() / "mesh.ply";
  WritePly(file, OneTriangle());
  const std::string said = Read(kMeshio, file);
  if (said.empty()) GTEST_SKIP() << "there is no reader; apt-get install python3-meshio";
  EXPECT_THAT(
      said,
      HasSubstr("[[0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [3.0, 0.0, 1.0]] [[[0, 1, 2]]] [-1.0, -1.0, -1.0]"));
}

TEST(DenseFiles, AGridIsWhatMapServerReads) {
  const auto folder = testing::FreshFolder();
  OccupancyGrid grid;
  grid.cell_m = 0.05;
  grid.origin = {-1.5, 2};
  grid.cells = cv::Mat(2, 3, CV_8SC1, cv::Scalar(-1));
  grid.cells.at<std::int8_t>(0, 0) = 0;    // least x and y: in the picture the last row's first pixel
  grid.cells.at<std::int8_t>(1, 2) = 100;  // the first row's last
  WriteGrid(folder / "navigation", grid);
  const std::string picture = ReadAll(folder / "navigation/map.pgm");
  EXPECT_EQ(picture, std::string("P5\n3 2\n255\n") + "\xCD\xCD" + std::string(1, '\0') + "\xFE\xCD\xCD");
  const std::string yaml = ReadAll(folder / "navigation/map.yaml");
  for (const char* line :
       {"image: map.pgm\n", "resolution: 0.05\n", "origin: [-1.500000, 2.000000, 0.0]\n", "negate: 0\n",
        "occupied_thresh: 0.65\n", "free_thresh: 0.196\n", "mode: trinary\n"})
    EXPECT_THAT(yaml, HasSubstr(line));
}

TEST(DenseFiles, AFullDiskIsSaidAndLeavesWhatWasThere) {
  const auto file = testing::FreshFolder() / "mesh.ply";
  testing::WriteAll(file, "before");
  TriangleMesh mesh = OneTriangle();
  mesh.triangles.resize(1000, mesh.triangles.front());
  {
    const testing::FullDisk full(1000);
    EXPECT_THROW(WritePly(file, mesh), InputError);
  }
  EXPECT_EQ(ReadAll(file), "before");
}

double RightCellsOf(SyntheticScene scene, bool kinect_noise) {
  SyntheticOptions options = testing::SmallRgbdRoom(160, 120);
  options.scene = scene;
  options.laps = 1;
  options.corridor_m = 14;
  options.kinect_noise = kinect_noise;
  const testing::RenderedWorld world(options);
  DenseOptions dense;
  dense.threads = 2;
  DenseMap map(dense);
  const std::size_t step = scene == SyntheticScene::kRoom ? 4 : 6;
  for (std::size_t i = 0; i < world.Size(); i += step) {
    const SyntheticFrame frame = world.Render(i);
    EXPECT_EQ(map.Integrate(frame.depth_m, frame.image, frame.T_world_camera, world.Camera()), "");
  }
  const OccupiedSpace space = map.Space();
  EXPECT_TRUE(space.ground_found);
  const OccupancyGrid grid = GridOf(space);
  EXPECT_GT(cv::countNonZero(grid.cells == 0), 2000);
  EXPECT_GT(cv::countNonZero(grid.cells == 100), 300);
  return testing::ShareOfRightCells(world.World(), grid, 0.1, 1.0);
}

TEST(DenseGrid, TheCellsOfARoomAreRight) {
  EXPECT_GT(RightCellsOf(SyntheticScene::kRoom, false), 0.97);
  EXPECT_GT(RightCellsOf(SyntheticScene::kRoom, true), 0.97);
}

TEST(DenseGrid, TheCellsOfACorridorAreRight) {
  EXPECT_GT(RightCellsOf(SyntheticScene::kCorridor, false), 0.97);
}

}  // namespace
}  // namespace tutti
