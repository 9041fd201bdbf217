// Landmarks and cameras as PLY, read by meshio.
#include "apps/export/map_files.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/apps/export/mapped_room.h"
#include "tests/apps/export/two_cameras.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

// meshio 5.0 takes uchar for signed.
constexpr const char* kReader = R"(
import json, sys
try:
    import meshio
except ImportError:
    sys.exit(77)
mesh = meshio.read(sys.argv[1])
out = {name: [int(v) for v in values] for name, values in mesh.point_data.items()}
for name in ("red", "green", "blue"):
    out[name] = [v & 255 for v in out[name]]
out["points"] = mesh.points.tolist()
out["cells"] = {block.type: block.data.tolist() for block in mesh.cells}
json.dump(out, sys.stdout)
)";

/// What meshio makes of a file; null where there is none.
nlohmann::json ReadPly(const std::filesystem::path& file) {
  const testing::ProcessResult said =
      testing::RunProgramAndSignal("/usr/bin/python3", {"-c", kReader, file.string()}, "", 0);
  if (said.status == 77 || said.status == 127) return {};
  EXPECT_EQ(said.status, 0) << said.output;
  return nlohmann::json::parse(said.output, nullptr, false);
}

Eigen::Vector3d Point(const nlohmann::json& ply, std::size_t i) {
  const auto& p = ply["points"][i];
  return {p[0].get<double>(), p[1].get<double>(), p[2].get<double>()};
}

// Where there is no reader, the test is skipped.
constexpr const char* kNoReader = "there is no reader; apt-get install python3-meshio";

TEST(Ply, HasPlacesColoursAndObservationsOfLandmarks) {
  const auto file = testing::FreshFolder() / "points.ply";
  WritePly(file, testing::TwoCameras(), PlyCameras::kNone);
  const nlohmann::json ply = ReadPly(file);
  if (ply.is_null()) GTEST_SKIP() << kNoReader;
  ASSERT_EQ(ply["points"].size(), 3u);
  EXPECT_EQ(Point(ply, 0), Eigen::Vector3d(5, 2, 3));
  EXPECT_EQ(Point(ply, 1), Eigen::Vector3d(2, 1, 4));
  EXPECT_EQ(ply["red"], nlohmann::json({255, 0, 128}));
  EXPECT_EQ(ply["green"], nlohmann::json({10, 200, 128}));
  EXPECT_EQ(ply["blue"], nlohmann::json({20, 100, 128}));
  EXPECT_EQ(ply["observations"], nlohmann::json({2, 2, 1}));
  EXPECT_TRUE(ply["cells"].empty());
}

// The keyframes are sqrt(14) m apart.
TEST(Ply, CamerasArePyramidsThatOpenTheWayTheyLook) {
  const auto file = testing::FreshFolder() / "map.ply";
  WritePly(file, testing::TwoCameras(), PlyCameras::kFrusta);
  const nlohmann::json ply = ReadPly(file);
  if (ply.is_null()) GTEST_SKIP() << kNoReader;
  ASSERT_EQ(ply["points"].size(), 3u + 2 * 5);
  const double depth = 0.5 * std::sqrt(14.0);
  // Pixels from -0.5 to 639.5 and 479.5; principal point 300, 200; focal lengths 500, 400.
  const double left = depth * -300.5 / 500, right = depth * 339.5 / 500, top = depth * -200.5 / 400,
               bottom = depth * 279.5 / 400;
  const Eigen::Vector3d first[5] = {
      {0, 0, 0}, {left, top, depth}, {right, top, depth}, {right, bottom, depth}, {left, bottom, depth}};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_LT((Point(ply, 3 + i) - first[i]).norm(), 1e-6) << i;
    const Eigen::Vector3d second(1 + first[i].z(), 2 + first[i].y(), 3 - first[i].x());
    EXPECT_LT((Point(ply, 8 + i) - second).norm(), 1e-6) << i;
  }
  EXPECT_EQ(ply["observations"][3], 0);
  ASSERT_EQ(ply["cells"]["triangle"].size(), 12u);
  // Seen from outside, corners go anticlockwise: normals point away from the middle of the pyramid.
  for (const auto& triangle : ply["cells"]["triangle"]) {
    const std::size_t pyramid = triangle[0].get<std::size_t>() < 8 ? 3 : 8;
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < 5; ++i) middle += 0.2 * Point(ply, pyramid + i);
    const Eigen::Vector3d a = Point(ply, triangle[0]), b = Point(ply, triangle[1]),
                          c = Point(ply, triangle[2]);
    EXPECT_GT((b - a).cross(c - a).dot(a - middle), 0);
  }
}

TEST(Ply, OfARealMapIsReadInFull) {
  const MapModel model = testing::Room().Model();
  const auto file = testing::FreshFolder() / "room.ply";
  WritePly(file, model, PlyCameras::kFrusta);
  const nlohmann::json ply = ReadPly(file);
  if (ply.is_null()) GTEST_SKIP() << kNoReader;
  ASSERT_EQ(ply["points"].size(), model.landmarks.size() + 5 * model.keyframes.size());
  EXPECT_EQ(ply["cells"]["triangle"].size(), 6 * model.keyframes.size());
  for (std::size_t i = 0; i < model.landmarks.size(); ++i) {
    EXPECT_LT((Point(ply, i) - model.landmarks[i].position).norm(), 1e-5) << i;
    EXPECT_EQ(ply["observations"][i], model.landmarks[i].observations) << i;
  }
}

TEST(Ply, ThatCantBeWrittenIsAnError) {
  EXPECT_THROW(WritePly("/nowhere/map.ply", testing::TwoCameras(), PlyCameras::kNone), InputError);
}

}  // namespace
}  // namespace tutti
