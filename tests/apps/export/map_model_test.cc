// What an export is made from: the map as it is after the last correction.
#include "apps/export/map_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "tests/apps/export/mapped_room.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

TEST(MapModel, HoldsWhatTheKeyframesSeeWithinAPixelOfItsProjection) {
  const MapModel model = testing::Room().Model();
  std::map<int, const ModelLandmark*> landmarks;
  for (const ModelLandmark& landmark : model.landmarks) landmarks[landmark.id] = &landmark;
  std::map<int, int> seen;
  double sum = 0;
  std::size_t views = 0;
  for (const ModelKeyframe& keyframe : model.keyframes) {
    const Pose T_camera_world = keyframe.T_world_camera.Inverse();
    for (const SeenLandmark& view : keyframe.views) {
      ASSERT_TRUE(landmarks.count(view.landmark)) << view.landmark;
      const Eigen::Vector3d point = T_camera_world * landmarks[view.landmark]->position;
      ASSERT_GT(point.z(), 0);
      sum += (model.camera.Project(point) - Eigen::Vector2d(view.pixel.x, view.pixel.y)).squaredNorm();
      ++views;
      ++seen[view.landmark];
    }
  }
  for (const ModelLandmark& landmark : model.landmarks)
    EXPECT_EQ(seen[landmark.id], landmark.observations) << landmark.id;
  EXPECT_GT(model.landmarks.size(), 1000u);
  EXPECT_LT(std::sqrt(sum / static_cast<double>(views)), 1.0);
  EXPECT_EQ(model.graph.nodes().size(), model.keyframes.size());
  EXPECT_EQ(model.trajectory.size(), testing::Room().dataset->Size());
}

TEST(MapModel, FollowsACorrection) {
  Odometry odometry = *testing::Room().slam->odometry();
  const MapModel before = ModelOf(odometry, PoseGraph());
  const Pose moved(ExpSO3({0, 0.3, 0}), {1, 0, -2});
  std::map<int, Similarity> corrected;
  for (const int id : odometry.map().KeyframeIds())
    corrected[id] = Similarity(moved * odometry.map().keyframe(id).T_world_camera);
  odometry.Correct({corrected});
  const MapModel after = ModelOf(odometry, PoseGraph());
  ASSERT_EQ(after.landmarks.size(), before.landmarks.size());
  for (std::size_t i = 0; i < before.landmarks.size(); ++i) {
    EXPECT_LT((after.landmarks[i].position - moved * before.landmarks[i].position).norm(), 1e-9);
    EXPECT_EQ(after.landmarks[i].observations, before.landmarks[i].observations);
  }
  ASSERT_EQ(after.keyframes.size(), before.keyframes.size());
  for (std::size_t k = 0; k < before.keyframes.size(); ++k) {
    const Pose error =
        (moved * before.keyframes[k].T_world_camera).Inverse() * after.keyframes[k].T_world_camera;
    EXPECT_LT(error.translation.norm() + error.Angle(), 1e-9);
  }
}

// The second piece is another place, in a frame of reference of its own.
TEST(MapModel, LeavesOutWhatWasNeverJoinedToTheLargestPiece) {
  SyntheticOptions options;
  options.scene = SyntheticScene::kTown;
  options.sensor = SyntheticSensor::kStereo;
  options.width = 400;
  options.height = 200;
  options.supersample = 1;
  const testing::RenderedWorld world(options);
  testing::Recording recording = testing::Record(world, 20);
  const InputFrame black = testing::Black(recording.frames.back());
  for (int i = 0; i < 15; ++i) recording.frames.push_back(black);
  for (std::size_t i = 150; i < 160; ++i) recording.Add(world.Render(i));
  Odometry odometry(OdometryOptions{}, recording.rig);
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    recording.frames[i].index = static_cast<std::int64_t>(i);
    recording.frames[i].stamp_s = 0.1 * static_cast<double>(i);
    odometry.Track(recording.frames[i]);
  }
  odometry.FinishMapping();
  ASSERT_EQ(FramePieces(odometry.map()).size(), 2u);
  const MapModel model = ModelOf(odometry, PoseGraph());
  EXPECT_GT(model.other_keyframes, 0u);
  EXPECT_EQ(model.keyframes.size() + model.other_keyframes, odometry.map().KeyframeIds().size());
  EXPECT_LT(model.keyframes.back().frame_index, 20);
  EXPECT_LT(model.landmarks.size(), odometry.map().LandmarkIds().size());
}

TEST(MapModel, OfAnEmptyMapIsRefused) {
  const Odometry odometry(OdometryOptions{}, testing::Room().dataset->Rig());
  EXPECT_THROW(ModelOf(odometry, PoseGraph()), InputError);
}

}  // namespace
}  // namespace tutti
