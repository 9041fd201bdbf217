// The numbers of COLMAP's files, worked out by hand, and read by COLMAP.
#include "apps/export/colmap_model.h"

#include <gtest/gtest.h>

#include "tests/apps/export/colmap_files.h"
#include "tests/apps/export/mapped_room.h"
#include "tests/apps/export/two_cameras.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

std::vector<double> Numbers(const std::vector<std::string>& words, std::size_t first, std::size_t count) {
  std::vector<double> numbers;
  for (std::size_t i = first; i < first + count; ++i) numbers.push_back(std::stod(words.at(i)));
  return numbers;
}

void ExpectNear(const std::vector<double>& a, const std::vector<double>& b, double tolerance) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], tolerance) << i;
}

fs::path WrittenTwoCameras() {
  fs::path folder = testing::FreshFolder();
  ColmapModel(testing::TwoCameras(), {0, 1}).Write(folder);
  return folder;
}

TEST(ColmapModel, CameraHasItsPrincipalPointFromTheCornerOfTheImage) {
  const auto lines = testing::DataLines(WrittenTwoCameras() / "cameras.txt");
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0],
            std::vector<std::string>({"1", "PINHOLE", "640", "480", "500", "400", "300.5", "200.5"}));
}

TEST(ColmapModel, PosesAreWorldToCamera) {
  const auto lines = testing::DataLines(WrittenTwoCameras() / "images.txt");
  ASSERT_EQ(lines.size(), 4u);
  ExpectNear(Numbers(lines[0], 0, 9), {1, 1, 0, 0, 0, 0, 0, 0, 1}, 1e-15);
  EXPECT_EQ(lines[0][9], "frame_000004.png");
  const double half = std::sqrt(0.5);
  ExpectNear(Numbers(lines[2], 0, 9), {2, half, 0, -half, 0, 3, -2, -1, 1}, 1e-12);
  EXPECT_EQ(lines[2][9], "frame_000010.png");
}

// Landmark 12 has one view; its pixel is no point of the image.
TEST(ColmapModel, PixelsAreFromTheCornerOfTheImageAndPointAtTheirTracks) {
  const fs::path folder = WrittenTwoCameras();
  const auto images = testing::DataLines(folder / "images.txt");
  ExpectNear(Numbers(images[1], 0, 6), {550.5, 300.5, 10, 300.5 + 2500.0 / 3, 200.5 + 800.0 / 3, 8}, 1e-4);
  ExpectNear(Numbers(images[3], 0, 6), {300.5, 200.5, 8, -199.5, -199.5, 10}, 1e-12);
  const auto points = testing::DataLines(folder / "points3D.txt");
  ASSERT_EQ(points.size(), 2u);
  ExpectNear(Numbers(points[0], 0, 12), {8, 5, 2, 3, 255, 10, 20, 0, 1, 1, 2, 0}, 1e-4);
  ExpectNear(Numbers(points[1], 0, 12), {10, 2, 1, 4, 0, 200, 100, 0, 1, 0, 2, 1}, 1e-4);
}

TEST(ColmapModel, ErrorIsTheMeanDistanceFromTheProjections) {
  MapModel model = testing::TwoCameras();
  model.keyframes[1].views[0].pixel += cv::Point2f(3, 4);
  const ColmapModel colmap(model, {0, 1});
  EXPECT_NEAR(colmap.Points()[0].error_px, 2.5, 1e-4);
  EXPECT_NEAR(colmap.Points()[1].error_px, 0, 1e-4);
}

TEST(ColmapModel, WhatFewerThanTwoImagesSeeIsLeftOutAndCounted) {
  const ColmapModel both(testing::TwoCameras(), {0, 1}), second(testing::TwoCameras(), {1});
  EXPECT_EQ(both.LeftOut(), 1u);
  EXPECT_EQ(both.MeanTrackLength(), 2.0);
  EXPECT_TRUE(second.Points().empty());
  EXPECT_EQ(second.LeftOut(), 3u);
  EXPECT_EQ(second.MeanTrackLength(), 0.0);
  EXPECT_EQ(second.Images().at(0).id, 1u);
}

// COLMAP reads the binary files and writes what it read as text.
TEST(ColmapModel, BinaryAndTextAreTheSameForColmap) {
  TUTTI_REQUIRE_COLMAP();
  const fs::path ours = testing::FreshFolder(), theirs = ours / "theirs", binary = ours / "binary";
  const MapModel model = testing::Room().Model();
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < model.keyframes.size(); k += 2) chosen.push_back(k);
  ColmapModel(model, chosen).Write(ours);
  fs::create_directories(theirs);
  fs::create_directories(binary);
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) fs::copy(ours / name, binary);
  const auto said = testing::RunColmap(
      {"model_converter", "--input_path", binary, "--output_path", theirs, "--output_type", "TXT"});
  ASSERT_EQ(said.status, 0) << said.output;
  // COLMAP goes through its points in an order of its own.
  const auto by_id = [](const fs::path& file) {
    std::map<std::string, std::vector<std::string>> lines;
    for (const auto& line : testing::DataLines(file)) lines[line.at(0)] = line;
    return lines;
  };
  for (const char* name : {"cameras.txt", "points3D.txt"}) {
    const auto a = by_id(ours / name), b = by_id(theirs / name);
    ASSERT_EQ(a.size(), b.size()) << name;
    const bool words = std::string(name) == "cameras.txt";
    for (const auto& [id, line] : a) {
      ASSERT_EQ(line.size(), b.at(id).size());
      if (words) {
        EXPECT_EQ(line[1], b.at(id)[1]);
      }
      for (std::size_t i = words ? 2 : 0; i < line.size(); ++i)
        ASSERT_NEAR(std::stod(line[i]), std::stod(b.at(id)[i]), 1e-9) << name << " " << id << " " << i;
    }
  }
  const auto a = testing::DataLines(ours / "images.txt"), b = testing::DataLines(theirs / "images.txt");
  ASSERT_EQ(a.size(), b.size());
  ASSERT_EQ(a.size(), 2 * chosen.size());
  std::map<std::string, std::size_t> place;
  for (std::size_t i = 0; i < b.size(); i += 2) place[b[i].at(9)] = i;
  for (std::size_t i = 0; i < a.size(); i += 2) {
    const std::size_t j = place.at(a[i].at(9));
    ExpectNear(Numbers(a[i], 0, 9), Numbers(b[j], 0, 9), 1e-12);
    // COLMAP's text has pixels with six digits.
    ExpectNear(Numbers(a[i + 1], 0, a[i + 1].size()), Numbers(b[j + 1], 0, b[j + 1].size()), 1e-3);
  }
}

// COLMAP holds the first image and tvec[0] of the second: the scale is lost if that is near 0.
TEST(ColmapModel, TheFirstTwoImagesInTheFilesAreFarApart) {
  MapModel model = testing::TwoCameras();
  ModelKeyframe near = model.keyframes[0], far = model.keyframes[0], blind = model.keyframes[0];
  near.T_world_camera.translation = {0.1, 0, 5};
  far.T_world_camera.translation = {-6, 0, 0};
  blind.T_world_camera.translation = {60, 0, 0};
  blind.views.clear();
  model.keyframes = {model.keyframes[0], near, blind, far};
  const ColmapModel colmap(model, {0, 1, 2, 3});
  EXPECT_EQ(colmap.FileOrder(), std::vector<std::size_t>({1, 3, 0, 2}));
  const fs::path folder = testing::FreshFolder();
  colmap.Write(folder);
  const auto lines = testing::DataLines(folder / "images.txt");
  EXPECT_EQ(lines[0][0], "2");
  EXPECT_EQ(lines[2][0], "4");
  EXPECT_EQ(lines[4][0], "1");
}

TEST(ColmapModel, ThatCantBeWrittenIsAnError) {
  EXPECT_THROW(ColmapModel(testing::TwoCameras(), {0, 1}).Write("/nowhere"), InputError);
}

}  // namespace
}  // namespace tutti
