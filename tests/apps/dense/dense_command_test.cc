// `tutti dense` on what `tutti run` left, by the real executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <opencv2/imgcodecs.hpp>

#include "apps/reconstruct/depth_source.h"
#include "apps/reconstruct/written_maps.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/small_room.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::Done, testing::ExpectRefusal, testing::ReadAll, testing::RunTutti;
using ::testing::HasSubstr, ::testing::Not;

SyntheticOptions FewFramesOf(SyntheticSensor sensor) {
  SyntheticOptions options = testing::SmallRgbdRoom(320, 240);
  options.sensor = sensor;
  options.frames = 25;
  return options;
}

// A run of a generated room, made once.
struct RoomRun {
  explicit RoomRun(SyntheticSensor sensor)
      : data(testing::GeneratedDataset(FewFramesOf(sensor))),
        folder(testing::FreshFolder()),
        run(testing::RunMadeOnce(data / "config.yaml", data, {"--no-report", "--no-loops"})) {}
  fs::path data, folder, run;
};

TEST(DenseCommand, WritesWhatIsAskedForAndSaysWithWhatToOpenIt) {
  const RoomRun room(SyntheticSensor::kRgbd);
  const std::string said =
      Done(RunTutti({"dense", room.run, "--mesh", room.folder / "mesh.ply", "--cloud",
                     room.folder / "cloud.ply", "--grid", room.folder / "grid", "--voxel", "0.04"}));
  EXPECT_THAT(said, HasSubstr("25 of 25 frames integrated, 0 skipped"));
  for (const char* program : {"MeshLab", "CloudCompare", "map_server"}) EXPECT_THAT(said, HasSubstr(program));
  EXPECT_THAT(ReadAll(room.folder / "mesh.ply"), HasSubstr("property list uchar int vertex_indices"));
  EXPECT_THAT(ReadAll(room.folder / "cloud.ply"), Not(HasSubstr("element face")));
  EXPECT_THAT(ReadAll(room.folder / "grid/map.pgm"), HasSubstr("P5\n"));
}

TEST(DenseCommand, IsTheSameForAnyNumberOfThreads) {
  const RoomRun room(SyntheticSensor::kRgbd);
  std::vector<std::string> bytes;
  for (const char* threads : {"1", "3"}) {
    const fs::path folder = room.folder / threads;
    Done(RunTutti({"dense", room.run, "--mesh", room.folder / "mesh.ply", "--grid", room.folder / "grid",
                   "--threads", threads, "--voxel", "0.04", "--quiet"}));
    bytes.push_back(ReadAll(room.folder / "mesh.ply") + ReadAll(room.folder / "grid/map.pgm"));
  }
  EXPECT_TRUE(bytes[0] == bytes[1]);
}

TEST(DenseCommand, StereoPairsHaveASurfaceToo) {
  const RoomRun room(SyntheticSensor::kStereo);
  const std::string said = Done(RunTutti(
      {"dense", room.run, "--mesh", room.folder / "mesh.ply", "--voxel", "0.05", "--frames", "all"}));
  EXPECT_THAT(said, HasSubstr("25 of 25 frames integrated"));
  EXPECT_GT(fs::file_size(room.folder / "mesh.ply"), 20000u);
}

TEST(DenseCommand, OneCameraIsToldTheThreeWays) {
  const RoomRun room(SyntheticSensor::kMono);
  ExpectRefusal(RunTutti({"dense", room.run, "--mesh", room.folder / "mesh.ply"}),
                {"--sensor rgbd", "--sensor stereo", "--depth DIR"});
  EXPECT_FALSE(fs::exists(room.folder / "mesh.ply"));
}

TEST(DenseCommand, OneCameraTakesDepthOfAnyScaleFromAFolder) {
  const RoomRun room(SyntheticSensor::kMono);
  const fs::path depth = testing::GeneratedDataset(FewFramesOf(SyntheticSensor::kRgbd)) / "depth";
  const std::string said = Done(RunTutti({"dense", room.run, "--mesh", room.folder / "mesh.ply", "--depth",
                                          depth, "--min-frames", "1", "--voxel", "0.05"}));
  EXPECT_THAT(said, HasSubstr(", 0 skipped"));
  EXPECT_GT(fs::file_size(room.folder / "mesh.ply"), 20000u);
  ExpectRefusal(RunTutti({"dense", room.run, "--mesh", room.folder / "mesh.ply", "--depth", room.folder}),
                {"25 images", "in the order of their names"});
}

TEST(DenseCommand, BadFramesAreSkippedAndCounted) {
  const RoomRun room(SyntheticSensor::kRgbd);
  const fs::path data = room.folder / "data";
  fs::copy(room.data, data, fs::copy_options::recursive);
  std::vector<fs::path> files(fs::directory_iterator(data / "depth"), fs::directory_iterator{});
  std::sort(files.begin(), files.end());
  testing::WriteAll(files[3], "no image");
  testing::WriteAll(files[7], ReadAll(files[7]).substr(0, 500));
  const std::string said =
      Done(RunTutti({"dense", room.run, data, "--mesh", room.folder / "mesh.ply", "--voxel", "0.05"}));
  EXPECT_THAT(said, HasSubstr("23 of 25 frames integrated, 2 skipped"));
  EXPECT_THAT(said, HasSubstr("tutti: frame 3: "));
}

TEST(DenseCommand, BadCallsAreOneLineThatSaysWhatToDo) {
  const RoomRun room(SyntheticSensor::kRgbd);
  ExpectRefusal(RunTutti({"dense", room.run}), {"give --mesh, --cloud, --grid, --octomap or --esdf"});
  ExpectRefusal(RunTutti({"dense", room.folder, "--mesh", room.folder / "m.ply"}),
                {"map.tutti: is not there"});
  ExpectRefusal(RunTutti({"dense", room.run, "--mesh", room.folder / "no/m.ply"}), {"no/m.ply"});
  ExpectRefusal(RunTutti({"dense", room.run, "--mesh", room.run / "map.tutti"}), {"map.tutti"});
  ExpectRefusal(RunTutti({"dense", room.run, room.folder, "--mesh", room.folder / "m.ply"}), {});
  ExpectRefusal(RunTutti({"dense", room.run, "--mesh", room.folder / "m.ply", "--voxel", "100"}),
                {"voxel_m"});
}

TEST(DenseCommand, SaysWhereDepthAndPosesDisagree) {
  const RoomRun room(SyntheticSensor::kRgbd);
  const fs::path data = room.folder / "data";
  fs::copy(room.data, data, fs::copy_options::recursive);
  std::vector<fs::path> files(fs::directory_iterator(data / "depth"), fs::directory_iterator{});
  std::sort(files.begin(), files.end());
  for (const std::size_t frame : {15, 16, 20}) {
    cv::Mat depth = cv::imread(files[frame].string(), cv::IMREAD_UNCHANGED);
    cv::imwrite(files[frame].string(), 1.1 * depth);
  }
  const std::string said =
      Done(RunTutti({"dense", room.run, data, "--mesh", room.folder / "mesh.ply", "--voxel", "0.04"}));
  EXPECT_THAT(said, HasSubstr("depth and poses disagree in 3 frames (15 to 16, 20)"));
  const std::string good = Done(RunTutti({"dense", room.run, "--mesh", room.folder / "mesh.ply"}));
  EXPECT_THAT(good, Not(HasSubstr("disagree")));
}

TEST(PosedFrame, IsWhereItsNeighboursSayAMomentBeforeAndAfter) {
  PosedFrame frame;
  frame.T_world_camera.translation = {1, 2, 3};
  frame.velocity_before.head<3>() = Eigen::Vector3d(10, 0, 0);
  frame.velocity_after.head<3>() = Eigen::Vector3d(0, 20, 0);
  EXPECT_NEAR((frame.PoseLater(-0.1).translation - Eigen::Vector3d(0, 2, 3)).norm(), 0, 1e-12);
  EXPECT_NEAR((frame.PoseLater(0.1).translation - Eigen::Vector3d(1, 4, 3)).norm(), 0, 1e-12);
}

TEST(ReportSurface, IsThinnedToWhatIsAskedForAndKeepsItsShape) {
  TriangleMesh wall;
  constexpr std::uint32_t kSide = 120;
  for (std::uint32_t y = 0; y < kSide; ++y) {
    for (std::uint32_t x = 0; x < kSide; ++x) {
      wall.vertices.points.emplace_back(0.01F * static_cast<float>(x), 0.01F * static_cast<float>(y), 5);
      wall.vertices.colours.push_back({{200, 100, 10}});
      const std::uint32_t at = y * kSide + x;
      if (x + 1 == kSide || y + 1 == kSide) continue;
      wall.triangles.push_back({{at, at + 1, at + kSide}});
      wall.triangles.push_back({{at + 1, at + kSide + 1, at + kSide}});
    }
  }
  const TriangleMesh thin = Thinned(wall, 500);
  EXPECT_LE(thin.vertices.points.size(), 500u);
  EXPECT_GT(thin.vertices.points.size(), 250u);
  double area = 0;
  for (const auto& [a, b, c] : thin.triangles) {
    const Eigen::Vector3f& corner = thin.vertices.points.at(a);
    const Eigen::Vector3f normal =
        (thin.vertices.points.at(b) - corner).cross(thin.vertices.points.at(c) - corner);
    EXPECT_GT(normal.z(), 0);
    area += 0.5 * static_cast<double>(normal.z());
  }
  EXPECT_NEAR(area, 1.19 * 1.19, 0.2);
  EXPECT_NEAR(thin.vertices.points.front().z(), 5, 1e-6);
  EXPECT_EQ(thin.vertices.colours.front(), (std::array<std::uint8_t, 3>{{200, 100, 10}}));
  EXPECT_EQ(Thinned(wall, 100000).vertices.points.size(), wall.vertices.points.size());
}

TEST(DenseCommand, CtrlCWritesWhatIsComplete) {
  const RoomRun room(SyntheticSensor::kRgbd);
  const testing::ProcessResult run =
      testing::RunTuttiAndSignal({"dense", room.run, "--mesh", room.folder / "mesh.ply", "--min-frames", "1",
                                  "--voxel", "0.01", "--threads", "1"},
                                 "dense  ", SIGINT);
  EXPECT_EQ(run.status, 130) << run.output;
  EXPECT_THAT(run.output, HasSubstr("interrupted; the files have what was integrated by then"));
  EXPECT_THAT(ReadAll(room.folder / "mesh.ply"), HasSubstr("end_header"));
}

TEST(DenseCommand, ARunMakesAMeshAtItsEnd) {
  const RoomRun room(SyntheticSensor::kRgbd);
  const fs::path out = room.folder / "out";
  const std::string said = Done(
      RunTutti(testing::RunArguments(room.data / "config.yaml", room.data, out, {"--no-loops", "--dense"})));
  EXPECT_THAT(said, HasSubstr("mesh.ply: "));
  EXPECT_THAT(ReadAll(out / "report.json"), HasSubstr("\"surface\":{\"low\":["));
  EXPECT_GT(fs::file_size(out / "mesh.ply"), 20000u);
  ExpectRefusal(
      RunTutti(testing::RunArguments(room.data / "config.yaml", room.data, out, {"--dense", "--no-map"})),
      {"--no-map"});
  EXPECT_TRUE(fs::exists(out / "mesh.ply"));
}

}  // namespace
}  // namespace tutti
