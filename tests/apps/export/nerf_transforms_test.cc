#include "apps/export/map_files.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/apps/export/two_cameras.h"

namespace tutti {
namespace {

Eigen::Matrix4d Matrix(const nlohmann::json& rows) {
  Eigen::Matrix4d matrix;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c)
      matrix(r, c) = rows[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)].get<double>();
  }
  return matrix;
}

const nlohmann::json& Transforms() {
  static const nlohmann::json json =
      nlohmann::json::parse(NerfTransforms(testing::TwoCameras(), {0, 1}, "sparse_pc.ply"));
  return json;
}

TEST(NerfTransforms, CameraHasItsPrincipalPointFromTheCornerOfTheImage) {
  EXPECT_EQ(Transforms()["w"], 640);
  EXPECT_EQ(Transforms()["h"], 480);
  EXPECT_EQ(Transforms()["fl_x"], 500.0);
  EXPECT_EQ(Transforms()["fl_y"], 400.0);
  EXPECT_EQ(Transforms()["cx"], 300.5);
  EXPECT_EQ(Transforms()["cy"], 200.5);
  EXPECT_EQ(Transforms()["ply_file_path"], "sparse_pc.ply");
}

TEST(NerfTransforms, CameraAxesAreOpenGls) {
  ASSERT_EQ(Transforms()["frames"].size(), 2u);
  EXPECT_EQ(Transforms()["frames"][0]["file_path"], "images/frame_000004.png");
  // In the origin, looking along the world's z: right is x, up is -y, backward is -z.
  Eigen::Matrix4d first = Eigen::Matrix4d::Identity();
  first(1, 1) = first(2, 2) = -1;
  EXPECT_LT((Matrix(Transforms()["frames"][0]["transform_matrix"]) - first).norm(), 1e-12);
  // In (1, 2, 3), looking along the world's x: right is -z, up is -y, backward is -x.
  Eigen::Matrix4d second;
  second << 0, 0, -1, 1,  //
      0, -1, 0, 2,        //
      -1, 0, 0, 3,        //
      0, 0, 0, 1;
  EXPECT_LT((Matrix(Transforms()["frames"][1]["transform_matrix"]) - second).norm(), 1e-12);
}

// The way of a trainer: a ray through a pixel of OpenGL's camera (x right, y up, -z forward) meets the
// landmark.
TEST(NerfTransforms, RaysOfPixelsMeetTheLandmarks) {
  const MapModel model = testing::TwoCameras();
  for (std::size_t k = 0; k < 2; ++k) {
    const Eigen::Matrix4d pose = Matrix(Transforms()["frames"][k]["transform_matrix"]);
    for (const SeenLandmark& view : model.keyframes[k].views) {
      const double u = view.pixel.x + 0.5, v = view.pixel.y + 0.5;
      const Eigen::Vector3d ray((u - Transforms()["cx"].get<double>()) / Transforms()["fl_x"].get<double>(),
                                -(v - Transforms()["cy"].get<double>()) / Transforms()["fl_y"].get<double>(),
                                -1);
      for (const ModelLandmark& landmark : model.landmarks) {
        if (landmark.id != view.landmark) continue;
        const Eigen::Vector3d to = landmark.position - pose.topRightCorner<3, 1>();
        EXPECT_LT(((pose.topLeftCorner<3, 3>() * ray).normalized() - to.normalized()).norm(), 1e-6);
      }
    }
  }
}

}  // namespace
}  // namespace tutti
