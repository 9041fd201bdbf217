// Surfaces of rooms whose geometry is known.
#include "tutti/dense/dense_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

#include "tests/apps/dense/known_geometry.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_room.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"
#include "tutti/dense/dense_files.h"

namespace tutti {
namespace {

constexpr double kVoxel = 0.02;

DenseOptions Voxels(double voxel_m) {
  DenseOptions options;
  options.voxel_m = voxel_m;
  options.free_space = false;
  return options;
}

SyntheticOptions LapOfARoom(bool kinect_noise) {
  SyntheticOptions options = testing::SmallRgbdRoom(320, 240);
  options.laps = 1;
  options.kinect_noise = kinect_noise;
  return options;
}

// Every fourth frame of a lap.
void Integrate(const testing::RenderedWorld& world, DenseMap* map,
               std::vector<Eigen::Vector3d>* seen = nullptr) {
  for (std::size_t i = 0; i < world.Size(); i += 4) {
    const SyntheticFrame frame = world.Render(i);
    ASSERT_EQ(map->Integrate(frame.depth_m, frame.image, frame.T_world_camera, world.Camera()), "") << i;
    if (seen != nullptr && i % 16 == 0)
      testing::AppendSeen(frame.depth_m, frame.T_world_camera, world.Camera(), 9, seen);
  }
}

std::string Bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

PinholeCamera Camera() {
  PinholeCamera camera;
  camera.width = 80, camera.height = 60;
  camera.fx = camera.fy = 70;
  camera.cx = 39.5, camera.cy = 29.5;
  return camera;
}

cv::Mat Wall(double z) { return cv::Mat(60, 80, CV_32FC1, cv::Scalar(z)); }

TEST(DenseMap, VerticesLieOnTheWallsOfARoom) {
  const testing::RenderedWorld world(LapOfARoom(false));
  DenseMap map(Voxels(kVoxel));
  std::vector<Eigen::Vector3d> seen;
  Integrate(world, &map, &seen);
  const TriangleMesh mesh = map.Mesh();
  const testing::KnownGeometry geometry(StillFaces(world.World()), 1);
  const testing::SurfaceQuality quality = testing::Measure(mesh.vertices, geometry, seen, kVoxel);
  EXPECT_LT(quality.rms, 0.15 * kVoxel);
  EXPECT_LT(quality.worst, 2.5 * kVoxel);  // the band ends at 4: none lies behind it
  EXPECT_GT(quality.completeness, 0.97);
  EXPECT_EQ(map.Report().integrated, (world.Size() + 3) / 4);
  EXPECT_LT(map.Report().memory_mb, 150);
}

TEST(DenseMap, NoiseOfAKinectAveragesOut) {
  const testing::RenderedWorld world(LapOfARoom(true));
  DenseMap map(Voxels(kVoxel));
  Integrate(world, &map);
  const testing::KnownGeometry geometry(StillFaces(world.World()), 1);
  const testing::SurfaceQuality quality = testing::Measure(map.Mesh().vertices, geometry, {}, kVoxel);
  EXPECT_LT(quality.rms, 0.004);
  EXPECT_EQ(map.Report().apart, 0u);
}

TEST(DenseMap, DepthThatLiesElsewhereThanTheSurfaceIsCounted) {
  DenseMap map(Voxels(kVoxel));
  const auto look = [&](double from_z) {
    Pose pose;
    pose.translation.z() = from_z;
    ASSERT_EQ(map.Integrate(Wall(1), {}, pose, Camera()), "");
  };
  for (int i = 0; i < 5; ++i) look(0.01 * i - 0.02);
  EXPECT_EQ(map.Report().apart, 0u);
  look(-0.1);
  EXPECT_EQ(map.Report().apart, 1u);
  EXPECT_NEAR(map.Report().apart_m, 0.1, 0.01);
  look(3);  // of a wall that nothing is known about
  EXPECT_EQ(map.Report().apart, 1u);
}

TEST(DenseMap, TrianglesAndNormalsFaceTheCamera) {
  DenseMap map(Voxels(kVoxel));
  const Pose pose;
  cv::Mat slant(60, 80, CV_32FC1);
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 80; ++u) slant.at<float>(v, u) = 1.0F / (0.7F + 0.001F * static_cast<float>(u));
  for (int i = 0; i < 3; ++i) ASSERT_EQ(map.Integrate(slant, {}, pose, Camera()), "");
  const TriangleMesh mesh = map.Mesh();
  ASSERT_GT(mesh.triangles.size(), 1000u);
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f& corner = mesh.vertices.points[a];
    const Eigen::Vector3f normal = (mesh.vertices.points[b] - corner).cross(mesh.vertices.points[c] - corner);
    EXPECT_LE(normal.dot(corner), 0) << corner.transpose();
  }
  for (std::size_t i = 0; i < mesh.vertices.points.size(); ++i) {
    EXPECT_LT(mesh.vertices.normals[i].dot(mesh.vertices.points[i]), 0);
    EXPECT_NEAR(mesh.vertices.normals[i].norm(), 1, 1e-5);
    EXPECT_EQ(mesh.vertices.colours[i], (std::array<std::uint8_t, 3>{{128, 128, 128}}));
  }
}

TEST(DenseMap, ColoursAreThoseOfTheImageRedFirst) {
  DenseMap map(Voxels(kVoxel));
  const cv::Mat image(60, 80, CV_8UC3, cv::Scalar(10, 100, 200));
  for (int i = 0; i < 3; ++i) ASSERT_EQ(map.Integrate(Wall(1), image, Pose(), Camera()), "");
  const PointCloud cloud = map.Cloud();
  ASSERT_GT(cloud.points.size(), 500u);
  EXPECT_LT(cloud.points.size(), map.Mesh().vertices.points.size() + 1);
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    EXPECT_EQ(cloud.colours[i], (std::array<std::uint8_t, 3>{{200, 100, 10}}));
    EXPECT_NEAR(cloud.points[i].z(), 1, 1e-3);
  }
}

TEST(DenseMap, WhatStoodAWhileInTheWayIsGoneWhenTheWallBehindWasSeenMoreOften) {
  DenseMap map(Voxels(kVoxel));
  for (int i = 0; i < 5; ++i) ASSERT_EQ(map.Integrate(Wall(0.7), {}, Pose(), Camera()), "");
  for (int i = 0; i < 20; ++i) ASSERT_EQ(map.Integrate(Wall(1), {}, Pose(), Camera()), "");
  for (const Eigen::Vector3f& point : map.Mesh().vertices.points) EXPECT_NEAR(point.z(), 1, 0.05);
}

TEST(DenseMap, SameBytesForAnyNumberOfThreads) {
  const testing::RenderedWorld world(LapOfARoom(true));
  const auto folder = testing::FreshFolder();
  std::vector<std::string> meshes, clouds, pictures;
  for (const int threads : {1, 3, 16}) {
    DenseOptions options;
    options.voxel_m = 0.05;
    options.threads = threads;
    DenseMap map(options);
    Integrate(world, &map);
    WritePly(folder / "mesh.ply", map.Mesh());
    WritePly(folder / "cloud.ply", map.Cloud());
    WriteGrid(folder, map.Grid());
    meshes.push_back(Bytes(folder / "mesh.ply"));
    clouds.push_back(Bytes(folder / "cloud.ply"));
    pictures.push_back(Bytes(folder / "map.pgm") + Bytes(folder / "map.yaml"));
  }
  ASSERT_GT(meshes[0].size(), 10000u);
  for (const std::size_t i : {1, 2}) {
    EXPECT_TRUE(meshes[i] == meshes[0]);
    EXPECT_TRUE(clouds[i] == clouds[0]);
    EXPECT_TRUE(pictures[i] == pictures[0]);
  }
}

TEST(DenseMap, BadFramesAreSkippedWithTheReasonAndLeaveTheMapAsItWas) {
  DenseMap map(Voxels(kVoxel));
  for (int i = 0; i < 3; ++i) ASSERT_EQ(map.Integrate(Wall(1), {}, Pose(), Camera()), "");
  const std::size_t vertices = map.Mesh().vertices.points.size();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Pose lost;
  lost.translation.x() = std::numeric_limits<double>::quiet_NaN();
  Pose far;
  far.translation.x() = 1e9;
  PinholeCamera fisheye = Camera();
  fisheye.distortion = Distortion::kEquidistant;
  const auto says = [&](const cv::Mat& depth, const cv::Mat& image, const Pose& pose,
                        const PinholeCamera& camera) { return map.Integrate(depth, image, pose, camera); };
  EXPECT_EQ(says({}, {}, Pose(), Camera()), "it has no depth image");
  EXPECT_EQ(says(cv::Mat(30, 40, CV_32FC1, cv::Scalar(1)), {}, Pose(), Camera()),
            "the depth image is 40x30, the camera 80x60");
  EXPECT_EQ(says(cv::Mat(60, 80, CV_16UC1, cv::Scalar(1000)), {}, Pose(), Camera()),
            "the depth image must hold metres as floats (CV_32FC1)");
  EXPECT_EQ(says(Wall(0), {}, Pose(), Camera()), "its depth image is empty");
  EXPECT_EQ(says(Wall(nan), {}, Pose(), Camera()), "its depth image is empty");
  EXPECT_EQ(says(Wall(1500), {}, Pose(), Camera()),
            "all its depth is beyond 200 m or max_depth_m; is its unit the metre?");
  EXPECT_EQ(says(Wall(1), cv::Mat(30, 40, CV_8UC1), Pose(), Camera()),
            "the image is 40x30, the depth image 80x60");
  EXPECT_EQ(says(Wall(1), {}, lost, Camera()), "its pose is not finite");
  EXPECT_EQ(says(Wall(1), {}, far, Camera()), "its pose is farther away than a map reaches");
  EXPECT_EQ(says(Wall(1), {}, Pose(), fisheye), "the camera must have no distortion");
  EXPECT_NE(says(Wall(1), {}, Pose(), PinholeCamera()), "");
  EXPECT_EQ(map.Report().integrated, 3u);
  EXPECT_EQ(map.Report().skipped, 11u);
  EXPECT_EQ(map.Mesh().vertices.points.size(), vertices);
}

TEST(DenseMap, HolesAndNotANumberAreNoSurface) {
  DenseMap map(Voxels(kVoxel));
  cv::Mat depth = Wall(1);
  depth(cv::Rect(0, 0, 40, 60)) = std::numeric_limits<float>::quiet_NaN();
  depth(cv::Rect(40, 0, 20, 60)) = 0;
  for (int i = 0; i < 3; ++i) ASSERT_EQ(map.Integrate(depth, {}, Pose(), Camera()), "");
  const TriangleMesh mesh = map.Mesh();
  ASSERT_FALSE(mesh.vertices.points.empty());
  for (const Eigen::Vector3f& point : mesh.vertices.points)
    EXPECT_GT(point.x(), 0.27F);  // pixel 60 is at 0.29 m
}

TEST(DenseMap, MemoryEndsWhereItWasToldAndTheReportSaysSo) {
  const testing::RenderedWorld world(LapOfARoom(false));
  DenseOptions options = Voxels(kVoxel);
  options.memory_mb = 5;
  DenseMap map(options);
  Integrate(world, &map);
  EXPECT_LE(map.Report().memory_mb, 5);
  EXPECT_GT(map.Report().memory_mb, 4.9);
  EXPECT_GT(map.Report().cut, 0u);
  EXPECT_EQ(map.Report().integrated, (world.Size() + 3) / 4);
  EXPECT_FALSE(map.Mesh().triangles.empty());
}

TEST(DenseMap, MemoryFollowsTheAreaNotTheTime) {
  const testing::RenderedWorld world(LapOfARoom(false));
  DenseMap map(Voxels(0.05));
  Integrate(world, &map);
  const std::size_t blocks = map.Report().blocks;
  for (int again = 0; again < 3; ++again) Integrate(world, &map);
  EXPECT_EQ(map.Report().blocks, blocks);
}

TEST(DenseMap, OptionsOutOfRangeAreRefused) {
  DenseOptions options;
  options.voxel_m = 0;
  EXPECT_THROW(DenseMap{options}, InputError);
}

TEST(DenseMap, AnEmptyMapHasNothing) {
  const DenseMap map(DenseOptions{});
  EXPECT_TRUE(map.Mesh().triangles.empty());
  EXPECT_TRUE(map.Cloud().points.empty());
  EXPECT_TRUE(map.Grid().cells.empty());
}

}  // namespace
}  // namespace tutti
