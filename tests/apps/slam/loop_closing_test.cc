// What the detector is told of keyframes: whose landmarks are in metres, and whose are not.
#include "apps/slam/map_merge.h"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/features2d.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/loopclosure/features/textured_image.h"

namespace tutti {
namespace {

// Flat places, one after the other, and each a second time from 3 % nearer.
class KeyframesOfPlaces : public ::testing::Test {
 protected:
  static constexpr int kPlaces = 14, kLandmarks = 150;
  static constexpr double kDepth = 4, kNearer = 1.03;  // testing::SeenAgain
  static constexpr double kDrift = 1.25;               // the unit has become so much smaller the second time

  static CameraRig Rig(Sensor sensor) {
    CameraRig rig;
    rig.sensor = sensor;
    rig.baseline_m = 0.1;
    rig.camera.width = 320;
    rig.camera.height = 240;
    rig.camera.fx = rig.camera.fy = 300;
    rig.camera.cx = 160;
    rig.camera.cy = 120;
    return rig;
  }
  static RunConfig Config() {
    RunConfig config;
    config.loops.stm_size = 3;
    config.loops.members = {"orb"};
    config.loops.extraction.features = 800;
    config.run.threads = 1;
    config.run.loop_delay_frames = 1;
    config.run.loop_min_interval_s = 0;
    return config;
  }
  static InputFrame Frame(int i) {
    InputFrame frame;
    frame.index = i;
    frame.stamp_s = i;
    const cv::Mat place = testing::TexturedImage(static_cast<std::uint32_t>(i % kPlaces), 320, 240);
    frame.image = i < kPlaces ? place : testing::SeenAgain(place);
    return frame;
  }
  // Every second feature is a landmark.
  static KeyframeView View(const InputFrame& frame, Sensor sensor) {
    KeyframeView view;
    view.id = static_cast<int>(frame.index);
    view.frame_index = frame.index;
    view.stamp_s = frame.stamp_s;
    cv::ORB::create(2 * kLandmarks)->detectAndCompute(frame.image, {}, view.keypoints, view.descriptors);
    const bool again = frame.index >= kPlaces;
    const double unit = sensor == Sensor::kMono && again ? kDrift : 1;
    const double depth = kDepth / (again ? kNearer : 1) * unit;
    for (std::size_t i = 0; i < view.keypoints.size(); ++i) {
      const cv::Point2f pixel = view.keypoints[i].pt;
      const bool known = i % 2 == 0;
      view.points.emplace_back(known
                                   ? Eigen::Vector3d(depth * Rig(sensor).camera.Unproject({pixel.x, pixel.y}))
                                   : Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
      view.landmarks.push_back(known ? static_cast<int>(i) : -1);
    }
    return view;
  }
  // Shows these frames, and says what the detector answers.
  std::vector<LoopResult> Show(LoopCloser* loops, Sensor sensor, int begin, int end) {
    results_.clear();
    for (int i = begin; i < end; ++i) {
      const InputFrame frame = Frame(i);
      const KeyframeView view = View(frame, sensor);
      loops->AddKeyframe(frame, &view, i);
      loops->Due(nullptr, i + 1);
    }
    return std::exchange(results_, {});
  }
  LoopCloser Closer(Sensor sensor) {
    return LoopCloser(Config(), Rig(sensor), nullptr,
                      {[this](const LoopResult& result) { results_.push_back(result); }, {}});
  }
  std::vector<LoopResult> results_;

  static int Expect(ConstraintType type, double scale, const Verification& verification) {
    if (!verification.accepted) return 0;
    EXPECT_EQ(ToString(verification.type), std::string(ToString(type)));
    EXPECT_NEAR(verification.S_candidate_query.scale, scale, 0.02);
    if (type != ConstraintType::kRigid) {
      EXPECT_GT(verification.inliers, kLandmarks) << "more than there are landmarks: all features count";
    }
    return 1;
  }
};

TEST_F(KeyframesOfPlaces, OneCamerasLandmarksAreNotInMetres) {
  for (const Sensor sensor : {Sensor::kMono, Sensor::kRgbd}) {
    const bool mono = sensor == Sensor::kMono;
    LoopCloser loops = Closer(sensor);
    int found = 0;
    for (const LoopResult& result : Show(&loops, sensor, 0, kPlaces + 5)) {
      found += Expect(mono ? ConstraintType::kSimilarity : ConstraintType::kRigid, mono ? 1 / kDrift : 1,
                      result.verification);
    }
    EXPECT_GE(found, 4);
  }
}

// Maps from before one camera said so have it that their landmarks are in metres.
TEST_F(KeyframesOfPlaces, WhatAnOlderMapSaysOfItsLandmarksMakesThemNoMetres) {
  LoopCloser loops = Closer(Sensor::kRgbd);
  Show(&loops, Sensor::kRgbd, 0, kPlaces);
  loops.BeginSession(Rig(Sensor::kMono), kPlaces, kPlaces);
  int found = 0;
  for (const LoopResult& result : Show(&loops, Sensor::kMono, kPlaces, kPlaces + 5))
    found += Expect(ConstraintType::kSimilarity, 1 / kDrift, result.verification);
  EXPECT_GE(found, 4);
}

TEST_F(KeyframesOfPlaces, NorAreThoseOfAnotherMapOfOneCamera) {
  const Sensor sensor = Sensor::kMono;
  LoopCloser loops = Closer(sensor), other = Closer(sensor);
  Show(&loops, sensor, 0, kPlaces);
  Show(&other, sensor, kPlaces, kPlaces + 5);
  loops.BeginSession(Rig(sensor), 1000 + kPlaces, kPlaces);
  const std::vector<MapMerge::Proposal> between = MapMerge::Compare(
      MapMerge::PlacesOf(&other), 1000,
      [&](std::int64_t frame) -> std::optional<KeyframeView> {
        return View(Frame(static_cast<int>(frame)), sensor);
      },
      &loops);
  int found = 0;
  for (const MapMerge::Proposal& proposal : between)
    found += Expect(ConstraintType::kSimilarity, 1 / kDrift, proposal.verification);
  EXPECT_GE(found, 4);
}

}  // namespace
}  // namespace tutti
