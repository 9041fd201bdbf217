#include "frontend/map/append.h"

#include <gtest/gtest.h>

#include <memory>
#include "frontend/features/features.h"

namespace tutti {
namespace {

PinholeCamera CameraOfSize(int width, int height, double f, double cx, double cy) {
  PinholeCamera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = f;
  camera.cx = cx;
  camera.cy = cy;
  return camera;
}

CameraRig RigWith(Sensor sensor, const PinholeCamera& camera) {
  CameraRig rig;
  rig.sensor = sensor;
  rig.camera = camera;
  return rig;
}

const std::vector<float> kScales = {1.0F, 1.2F, 1.44F, 1.728F, 2.0736F, 2.48832F};
const PinholeCamera kOld = CameraOfSize(640, 480, 500, 320, 240),
                    kNew = CameraOfSize(800, 600, 720, 390, 310);

// Two keyframes that see one point.
Map MapThatSees(const PinholeCamera& camera, const Eigen::Vector3d& point) {
  Map map(kScales, RigWith(Sensor::kStereo, camera), 0.5);
  for (int k = 0; k < 2; ++k) {
    auto features = std::make_shared<FrameFeatures>();
    const Pose T_world_camera(Eigen::Quaterniond::Identity(), {0.3 * k, 0, 0});
    const Eigen::Vector2d pixel = camera.Project(T_world_camera.Inverse() * point);
    features->keypoints.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 31.0F,
                                     0.0F, 1.0F, 1);
    features->descriptors = cv::Mat::zeros(1, 32, CV_8U);
    features->inverse_depth = {0.0F};
    features->inverse_depth_sigma = {0.0F};
    features->aligned = {-1};
    features->BuildGrid(camera.width, camera.height);
    Keyframe keyframe;
    keyframe.frame_index = 10 + k;
    keyframe.T_world_camera = T_world_camera;
    keyframe.features = features;
    map.AddKeyframe(keyframe);
  }
  const int landmark = map.AddLandmark(point, 0, 0);
  map.AddObservation(landmark, 1, 0);
  map.UpdateLandmark(landmark);
  return map;
}

TEST(OtherCamera, FeaturesAreWhereTheOtherCameraWouldHaveSeenThem) {
  const Eigen::Vector3d point(0.4, -0.3, 4);
  const Map map = MapThatSees(kOld, point);
  const Map carried = WithRig(map, RigWith(Sensor::kStereo, kNew));
  ASSERT_EQ(carried.KeyframeCount(), 2);
  for (int k = 0; k < 2; ++k) {
    const Keyframe& keyframe = carried.keyframe(k);
    const Eigen::Vector2d expected = kNew.Project(keyframe.T_world_camera.Inverse() * point);
    EXPECT_NEAR(keyframe.features->keypoints[0].pt.x, expected.x(), 1e-3);
    EXPECT_NEAR(keyframe.features->keypoints[0].pt.y, expected.y(), 1e-3);
    EXPECT_EQ(keyframe.features->keypoints[0].octave, 3);  // 1.44 times as large: two levels up
    EXPECT_TRUE(keyframe.features->other_camera);
    std::vector<int> near;
    keyframe.features->InArea(keyframe.features->keypoints[0].pt, 2, 0, 5, &near);
    EXPECT_EQ(near, std::vector<int>{0});
  }
  // A corner of its size is seen from as far.
  EXPECT_NEAR(carried.landmark(0).max_distance, 1.44F * map.landmark(0).max_distance, 1e-3);
  EXPECT_EQ(carried.landmark(0).observations.size(), 2u);
}

TEST(OtherCamera, OtherSensorsAndVeryOtherFocalLengthsAreNone) {
  const CameraRig stereo = RigWith(Sensor::kStereo, kOld);
  EXPECT_EQ(OtherCameraProblem(stereo, RigWith(Sensor::kStereo, kNew), kScales), "");
  EXPECT_NE(OtherCameraProblem(stereo, RigWith(Sensor::kMono, kOld), kScales).find("kind of sensor"),
            std::string::npos);
  PinholeCamera tele = kOld;
  tele.fx = tele.fy = 1500;
  EXPECT_NE(OtherCameraProblem(stereo, RigWith(Sensor::kStereo, tele), kScales).find("focal length"),
            std::string::npos);
  EXPECT_TRUE(SameCamera(stereo, stereo));
  EXPECT_FALSE(SameCamera(stereo, RigWith(Sensor::kStereo, kNew)));
}

TEST(OtherCamera, AnAppendedMapHasItsOwnNumbers) {
  Map map = MapThatSees(kOld, {0.4, -0.3, 4});
  Map other = MapThatSees(kOld, {-0.2, 0.1, 3});
  other.AddFrame(11, 1.1, 1, Pose());
  other.AddFrame(12, 1.2, 0, Pose());
  map.RestorePieces(5);
  Append(other, 1000, &map);
  ASSERT_EQ(map.KeyframeCount(), 4);
  ASSERT_EQ(map.LandmarkCount(), 2);
  EXPECT_EQ(map.keyframe(3).id, 3);
  EXPECT_EQ(map.keyframe(3).frame_index, 1011);
  EXPECT_EQ(map.keyframe(3).piece, 5);
  EXPECT_EQ(map.keyframe(3).landmarks, std::vector<int>{1});
  EXPECT_EQ(map.keyframe(2).covisible, (std::map<int, int>{{3, 1}}));
  EXPECT_EQ(map.landmark(1).observations.front().keyframe, 2);
  EXPECT_EQ(map.landmark(1).reference, 2);
  EXPECT_EQ(map.keyframe(1).covisible, (std::map<int, int>{{0, 1}}));
  EXPECT_EQ(map.NextPiece(), 6);
  EXPECT_EQ(FrameIndices(map, 5), (std::vector<std::int64_t>{1011, 1012}));
  EXPECT_EQ(map.frames()[0].keyframe, 3);
  EXPECT_EQ(map.frames()[0].before, -1);
  EXPECT_EQ(map.frames()[1].before, 3);
}

}  // namespace
}  // namespace tutti
