// A whole export: what is where, and that nothing of anybody else is touched.
#include "apps/export/map_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "tests/apps/export/colmap_files.h"
#include "tests/apps/export/mapped_room.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::set<std::string> NamesIn(const fs::path& folder) {
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.path().filename().string()[0] != '.') names.insert(entry.path().filename());
  }
  return names;
}

ExportReport ExportRoom(const ExportRequest& request) {
  return ExportMap(testing::Room().Model(), testing::Room().dataset.get(), request);
}

ExportRequest ColmapInto(const fs::path& folder, std::size_t images) {
  ExportRequest request;
  request.colmap = folder;
  request.images = images;
  return request;
}

TEST(MapExport, WritesAllFormatsAndSaysWhatOpensThem) {
  const fs::path folder = testing::FreshFolder();
  ExportRequest request = ColmapInto(folder / "model", 4);
  request.transforms = folder / "model" / "transforms.json";
  request.landmarks = folder / "map.ply";
  request.g2o = folder / "map.g2o";
  request.tum = folder / "map.tum";
  const ExportReport report = ExportRoom(request);
  EXPECT_EQ(report.files.size(), 5u);
  for (const ExportedFile& file : report.files) {
    EXPECT_TRUE(fs::exists(file.path)) << file.path;
    EXPECT_FALSE(file.content.empty() || file.open_with.empty()) << file.path;
  }
  EXPECT_EQ(NamesIn(folder / "model"),
            std::set<std::string>({"export.json", "images", "sparse", "sparse_pc.ply", "transforms.json"}));
  EXPECT_EQ(NamesIn(folder / "model/sparse/0"),
            std::set<std::string>(
                {"cameras.bin", "cameras.txt", "images.bin", "images.txt", "points3D.bin", "points3D.txt"}));
  // Both models show the same images, and they are there.
  std::set<std::string> colmap, transforms;
  for (const auto& [name, pose] : testing::ImagePoses(folder / "model/sparse/0/images.txt"))
    colmap.insert(name);
  const auto json = nlohmann::json::parse(testing::ReadAll(folder / "model/transforms.json"));
  for (const auto& frame : json["frames"])
    transforms.insert(fs::path(frame["file_path"].get<std::string>()).filename());
  EXPECT_EQ(colmap.size(), 4u);
  EXPECT_EQ(colmap, transforms);
  EXPECT_EQ(colmap, NamesIn(folder / "model/images"));
  const cv::Mat image =
      cv::imread((folder / "model/images" / *colmap.begin()).string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(image.type(), CV_8UC3);
  EXPECT_EQ(image.size(), cv::Size(640, 480));
}

TEST(MapExport, TrajectoryAndGraphAreThoseOfTheMap) {
  const fs::path folder = testing::FreshFolder();
  ExportRequest request;
  request.g2o = folder / "map.g2o";
  request.tum = folder / "map.tum";
  const MapModel model = testing::Room().Model();
  ExportMap(model, nullptr, request);
  const Trajectory read = ReadTrajectory(folder / "map.tum", TrajectoryFormat::kTum);
  ASSERT_EQ(read.size(), model.trajectory.size());
  for (std::size_t i = 0; i < read.size(); ++i)
    EXPECT_LT((read[i].pose.Inverse() * model.trajectory[i].pose).translation.norm(), 1e-8);
  const G2oFile graph = ReadG2o(folder / "map.g2o");
  for (const ModelKeyframe& keyframe : model.keyframes) {
    EXPECT_LT((graph.graph.Node(keyframe.id).pose.translation - keyframe.T_world_camera.translation).norm(),
              1e-12);
  }
}

TEST(MapExport, TheNextOneReplacesTheEarlierOneWithItsImages) {
  const fs::path folder = testing::FreshFolder();
  ExportRoom(ColmapInto(folder, 4));
  EXPECT_EQ(NamesIn(folder / "images").size(), 4u);
  testing::WriteAll(folder / "landmarks.ply", "of another call");
  ExportRoom(ColmapInto(folder, 2));
  EXPECT_EQ(NamesIn(folder / "images").size(), 2u);
  EXPECT_EQ(testing::DataLines(folder / "sparse/0/images.txt").size(), 4u);
  EXPECT_EQ(testing::ReadAll(folder / "landmarks.ply"), "of another call");
}

TEST(MapExport, AFolderWithForeignFilesIsRefusedAndLeftAlone) {
  const fs::path folder = testing::FreshFolder();
  testing::WriteAll(folder / "holiday.jpg", "me");
  const std::string error = testing::ErrorOf([&] { ExportRoom(ColmapInto(folder, 3)); });
  EXPECT_THAT(error, HasSubstr("holds holiday.jpg"));
  EXPECT_THAT(error, HasSubstr("choose another --colmap"));
  EXPECT_EQ(NamesIn(folder), std::set<std::string>({"holiday.jpg"}));
}

TEST(MapExport, AFolderOfImagesThatNoExportMadeIsRefused) {
  const fs::path folder = testing::FreshFolder();
  fs::create_directories(folder / "images");
  testing::WriteAll(folder / "images/1.png", "mine");
  ExportRequest request;
  request.transforms = folder / "transforms.json";
  EXPECT_THAT(testing::ErrorOf([&] { ExportRoom(request); }), HasSubstr("choose another --transforms"));
  EXPECT_EQ(testing::ReadAll(folder / "images/1.png"), "mine");
}

TEST(MapExport, TransformsMustHaveTheNameThatProgramsLookFor) {
  ExportRequest request;
  request.transforms = testing::FreshFolder() / "poses.json";
  EXPECT_THAT(testing::ErrorOf([&] { ExportRoom(request); }), HasSubstr("must be called transforms.json"));
}

TEST(MapExport, WithoutImagesLandmarksAreGreyAndModelsAreRefused) {
  const fs::path folder = testing::FreshFolder();
  ExportRequest request;
  request.landmarks = folder / "map.ply";
  const ExportReport report = ExportMap(testing::Room().Model(), nullptr, request);
  EXPECT_TRUE(fs::exists(folder / "map.ply"));
  ASSERT_EQ(report.warnings.size(), 1u);
  EXPECT_THAT(report.warnings[0], HasSubstr("grey"));
  EXPECT_THAT(
      testing::ErrorOf([&] { ExportMap(testing::Room().Model(), nullptr, ColmapInto(folder / "model", 3)); }),
      HasSubstr("--dataset"));
  EXPECT_THAT(testing::ErrorOf([] { ExportRoom({}); }), HasSubstr("nothing to export"));
}

TEST(MapExport, TheSameMapGivesTheSameBytes) {
  const fs::path folder = testing::FreshFolder();
  for (const char* name : {"a", "b"}) {
    ExportRequest request = ColmapInto(folder / name, 5);
    request.landmarks = folder / (std::string(name) + ".ply");
    ExportRoom(request);
  }
  EXPECT_EQ(testing::ReadAll(folder / "a.ply"), testing::ReadAll(folder / "b.ply"));
  for (const char* file : {"sparse/0/images.bin", "sparse/0/points3D.txt", "export.json"})
    EXPECT_EQ(testing::ReadAll(folder / "a" / file), testing::ReadAll(folder / "b" / file)) << file;
}

}  // namespace
}  // namespace tutti
