#include "tutti/frontend/odometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

using testing::Black;
using testing::Recording;
using testing::Snow;

SyntheticOptions SmallWorld(SyntheticScene scene, SyntheticSensor sensor) {
  SyntheticOptions options;
  options.scene = scene;
  options.sensor = sensor;
  options.width = 400;
  options.height = scene == SyntheticScene::kTown ? 200 : 300;
  options.blocks_x = 1;
  options.supersample = 1;
  return options;
}

Recording Record(SyntheticScene scene, SyntheticSensor sensor, std::size_t count) {
  return testing::Record(testing::RenderedWorld(SmallWorld(scene, sensor)), count);
}

const Recording& Stereo() {
  static const Recording recording = Record(SyntheticScene::kTown, SyntheticSensor::kStereo, 40);
  return recording;
}

std::vector<TrackResult> TrackAll(const Recording& recording, Odometry& odometry, std::size_t first = 0) {
  std::vector<TrackResult> results;
  for (std::size_t i = first; i < recording.frames.size(); ++i) {
    results.push_back(odometry.Track(recording.frames[i]));
  }
  return results;
}

double PathLength(const Trajectory& t) {
  double length = 0;
  for (std::size_t i = 1; i < t.size(); ++i)
    length += (t[i].pose.translation - t[i - 1].pose.translation).norm();
  return length;
}

// Error of the last pose relative to the first [m]; with `any_scale`, after scaling to the true path length.
double EndError(const Trajectory& truth, const Trajectory& estimate, bool any_scale) {
  Pose true_end = truth.front().pose.Inverse() * truth.back().pose;
  Pose end = estimate.front().pose.Inverse() * estimate.back().pose;
  if (any_scale) end.translation *= PathLength(truth) / PathLength(estimate);
  return (end.translation - true_end.translation).norm();
}

void ExpectSameBits(const Trajectory& a, const Trajectory& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].pose.Matrix(), b[i].pose.Matrix()) << i;
}

TEST(Odometry, StereoFollowsTheTruthInMetres) {
  Odometry odometry(OdometryOptions(), Stereo().rig);
  TrackAll(Stereo(), odometry);
  const Trajectory estimate = FrameTrajectory(odometry.map());
  ASSERT_EQ(estimate.size(), Stereo().frames.size());
  EXPECT_LT(EndError(Stereo().truth, estimate, false), 0.015 * PathLength(Stereo().truth));
  EXPECT_LT(odometry.Report().stereo_row_error_px, 0.5);
  EXPECT_GT(odometry.Report().stereo_matches, 100);
}

TEST(Odometry, SeenLandmarksGoOnFromFrameToFrame) {
  Odometry odometry(OdometryOptions(), Stereo().rig);
  EXPECT_TRUE(odometry.LastView().landmarks.empty());
  std::map<int, cv::Point2f> before;
  for (const InputFrame& frame : Stereo().frames) {
    const TrackResult track = odometry.Track(frame);
    ASSERT_EQ(track.state, TrackingState::kTracking);
    std::map<int, cv::Point2f> now;
    for (const SeenLandmark& seen : odometry.LastView().landmarks) now[seen.landmark] = seen.pixel;
    // A keyframe's include those that it made.
    if (track.keyframe < 0)
      EXPECT_EQ(now.size(), static_cast<std::size_t>(track.inliers)) << frame.index;
    else
      EXPECT_GE(now.size(), static_cast<std::size_t>(track.inliers)) << frame.index;
    std::size_t again = 0, near = 0;
    for (const auto& [landmark, pixel] : now) {
      const auto old = before.find(landmark);
      if (old == before.end()) continue;
      ++again;
      near += cv::norm(pixel - old->second) < 40 ? 1 : 0;
    }
    if (!before.empty()) {
      EXPECT_GT(2 * again, before.size()) << frame.index;
      EXPECT_GT(near, 0.95 * again) << frame.index;
    }
    before = now;
  }
}

TEST(Odometry, LandmarksAreThoseThatKeyframesSeeWithTheirNumberOfViews) {
  Odometry odometry(OdometryOptions{}, Stereo().rig);
  TrackAll(Stereo(), odometry);
  odometry.FinishMapping();
  std::map<int, int> views;
  for (const int id : odometry.map().KeyframeIds()) {
    for (const int landmark : ViewOf(odometry.map(), id).landmarks) {
      if (landmark >= 0) ++views[landmark];
    }
  }
  const std::vector<int> landmarks = odometry.map().LandmarkIds();
  ASSERT_EQ(landmarks.size(), views.size());
  auto expected = views.begin();
  for (const int id : landmarks) {
    const Landmark& landmark = odometry.map().landmark(id);
    EXPECT_EQ(id, expected->first);
    EXPECT_EQ(static_cast<int>(landmark.observations.size()), expected->second);
    EXPECT_TRUE(landmark.position.allFinite());
    ++expected;
  }
  EXPECT_EQ(odometry.map().rig().camera.fx, Stereo().rig.camera.fx);
  EXPECT_EQ(odometry.map().rig().baseline_m, Stereo().rig.baseline_m);
}

TEST(Odometry, RgbdFollowsTheTruthInMetres) {
  const Recording room = Record(SyntheticScene::kRoom, SyntheticSensor::kRgbd, 40);
  Odometry odometry(OdometryOptions(), room.rig);
  TrackAll(room, odometry);
  const Trajectory estimate = FrameTrajectory(odometry.map());
  ASSERT_EQ(estimate.size(), room.frames.size());
  EXPECT_LT(EndError(room.truth, estimate, false), 0.01 * PathLength(room.truth));
}

// Frames for which `absent` holds come with their image alone.
template <typename Absent>
Recording WithoutDepth(Recording recording, const Absent& absent) {
  for (InputFrame& frame : recording.frames) {
    if (absent(frame.index)) frame.right = frame.depth_m = cv::Mat();
  }
  return recording;
}

void ExpectKeyframesHaveDepth(const Odometry& odometry, const Recording& recording) {
  for (const int id : odometry.map().KeyframeIds()) {
    const InputFrame& frame =
        recording.frames.at(static_cast<std::size_t>(odometry.map().keyframe(id).frame_index));
    EXPECT_FALSE(frame.right.empty() && frame.depth_m.empty()) << frame.index;
  }
}

TEST(Odometry, EveryThirdFrameWithoutDepthIsTrackedWithColourAlone) {
  const Recording room = Record(SyntheticScene::kRoom, SyntheticSensor::kRgbd, 60);
  const Recording holes = WithoutDepth(room, [](std::int64_t i) { return i % 3 == 1; });
  Odometry odometry(OdometryOptions(), holes.rig);
  for (const TrackResult& track : TrackAll(holes, odometry))
    EXPECT_EQ(track.state, TrackingState::kTracking) << track.reason;
  const Trajectory estimate = FrameTrajectory(odometry.map());
  ASSERT_EQ(estimate.size(), room.frames.size());
  EXPECT_LT(EndError(room.truth, estimate, false), 0.01 * PathLength(room.truth));
  ExpectKeyframesHaveDepth(odometry, holes);
}

TEST(Odometry, FramesBeforeTheFirstDepthAreGivenTheirPosesOnceItComes) {
  const Recording room = Record(SyntheticScene::kRoom, SyntheticSensor::kRgbd, 20);
  const Recording late = WithoutDepth(room, [](std::int64_t i) { return i < 5; });
  Odometry odometry(OdometryOptions(), late.rig);
  const std::vector<TrackResult> results = TrackAll(late, odometry);
  EXPECT_EQ(results[4].state, TrackingState::kInitializing);
  EXPECT_THAT(results[4].reason, HasSubstr("waiting for a frame with depth"));
  EXPECT_EQ(results[5].keyframe, 0);
  const Trajectory estimate = FrameTrajectory(odometry.map());
  ASSERT_EQ(estimate.size(), room.frames.size());
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    EXPECT_EQ(estimate[i].stamp_s, room.truth[i].stamp_s);
    const Pose truth = room.truth[5].pose.Inverse() * room.truth[i].pose;  // the map begins there
    EXPECT_LT((estimate[i].pose.translation - truth.translation).norm(), 0.01) << i;
    EXPECT_LT((estimate[i].pose.Inverse() * truth).Angle(), 0.01) << i;
  }
}

TEST(Odometry, FramesWithoutTheirRightImageAreTrackedWithTheLeftAlone) {
  const Recording holes = WithoutDepth(Stereo(), [](std::int64_t i) { return i == 0 || i % 2 == 1; });
  Odometry odometry(OdometryOptions(), holes.rig);
  TrackAll(holes, odometry);
  const Trajectory estimate = FrameTrajectory(odometry.map());
  ASSERT_EQ(estimate.size(), holes.frames.size());
  EXPECT_LT(EndError(holes.truth, estimate, false), 0.015 * PathLength(holes.truth));
  ExpectKeyframesHaveDepth(odometry, holes);
  EXPECT_GT(odometry.Report().stereo_matches, 100) << "of the pairs";
}

TEST(Odometry, NoDepthAtAllStartsNoMap) {
  const Recording none = WithoutDepth(Stereo(), [](std::int64_t) { return true; });
  Odometry odometry(OdometryOptions(), none.rig);
  for (const TrackResult& track : TrackAll(none, odometry)) {
    EXPECT_EQ(track.state, TrackingState::kInitializing);
    EXPECT_THAT(track.reason, HasSubstr("waiting for a frame with depth"));
  }
  EXPECT_TRUE(FrameTrajectory(odometry.map()).empty());
}

TEST(Odometry, FastTurnsGetAKeyframeBeforeMostOfTheViewIsNew) {
  SyntheticOptions options = SmallWorld(SyntheticScene::kRoom, SyntheticSensor::kStereo);
  options.height = 256;
  options.rate_hz = 20;
  options.speed_mps = 1.5;  // and 30 degrees a second and more
  const Recording room = testing::Record(testing::RenderedWorld(options), 110);
  const auto error = [&](double uncovered_ratio) {
    OdometryOptions odometry_options;
    odometry_options.keyframe_uncovered_ratio = uncovered_ratio;
    Odometry odometry(odometry_options, room.rig);
    TrackAll(room, odometry);
    EXPECT_EQ(FrameTrajectory(odometry.map()).size(), room.frames.size());
    return EndError(room.truth, FrameTrajectory(odometry.map()), false) / PathLength(room.truth);
  };
  const double with = error(OdometryOptions().keyframe_uncovered_ratio), without = error(1);
  EXPECT_LT(with, 0.03);
  EXPECT_LT(with, 0.5 * without);
}

TEST(Odometry, MonoFollowsTheTruthUpToScaleAndPosesTheFirstFramesBackwards) {
  Recording mono = Stereo();
  mono.rig.sensor = Sensor::kMono;
  mono.rig.baseline_m = 0;
  for (InputFrame& frame : mono.frames) frame.right.release();
  Odometry odometry(OdometryOptions(), mono.rig);
  const std::vector<TrackResult> results = TrackAll(mono, odometry);
  EXPECT_EQ(results.front().state, TrackingState::kInitializing);
  EXPECT_FALSE(results.front().reason.empty());
  EXPECT_EQ(results.back().state, TrackingState::kTracking);
  const Trajectory estimate = FrameTrajectory(odometry.map());
  ASSERT_EQ(estimate.size(), mono.frames.size());
  EXPECT_LT(EndError(mono.truth, estimate, true), 0.03 * PathLength(mono.truth));
}

TEST(Odometry, SameFramesGiveTheSameBitsAndSoDoFeaturesExtractedBefore) {
  Odometry a(OdometryOptions(), Stereo().rig), b(OdometryOptions(), Stereo().rig);
  for (const InputFrame& frame : Stereo().frames) {
    a.Track(frame);
    InputFrame prepared = frame;
    prepared.features = b.Extract(frame);
    b.Track(prepared);
  }
  ExpectSameBits(FrameTrajectory(a.map()), FrameTrajectory(b.map()));
}

TEST(Odometry, CopyGoesOnAsTheOriginalWould) {
  Odometry odometry(OdometryOptions(), Stereo().rig);
  for (std::size_t i = 0; i < 20; ++i) odometry.Track(Stereo().frames[i]);
  Odometry copy(odometry);
  TrackAll(Stereo(), odometry, 20);
  TrackAll(Stereo(), copy, 20);
  ExpectSameBits(FrameTrajectory(odometry.map()), FrameTrajectory(copy.map()));
}

TEST(Odometry, CorrectionMovesTheMapAndTrackingGoesOnFromThere) {
  Odometry odometry(OdometryOptions(), Stereo().rig), plain(OdometryOptions(), Stereo().rig);
  for (std::size_t i = 0; i < 20; ++i) {
    odometry.Track(Stereo().frames[i]);
    plain.Track(Stereo().frames[i]);
  }
  const Pose shift(ExpSO3({0, 0.3, 0}), {5, -1, 2});
  std::map<int, Similarity> corrected;
  for (const int id : odometry.map().KeyframeIds())
    corrected[id] = Similarity(shift * odometry.map().keyframe(id).T_world_camera);
  odometry.Correct({corrected});
  TrackAll(Stereo(), odometry, 20);
  TrackAll(Stereo(), plain, 20);
  const Trajectory moved = FrameTrajectory(odometry.map()), expected = FrameTrajectory(plain.map());
  ASSERT_EQ(moved.size(), expected.size());
  for (std::size_t i = 0; i < moved.size(); ++i) {
    EXPECT_LT(LogSE3((shift * expected[i].pose).Inverse() * moved[i].pose).norm(), 0.02) << i;
  }
}

TEST(Odometry, BlackFrameIsLostWithAReasonAndTheNextOnesAreFoundAgain) {
  Odometry odometry(OdometryOptions(), Stereo().rig);
  for (std::size_t i = 0; i < Stereo().frames.size(); ++i) {
    const bool black = i == 20;
    const TrackResult result = odometry.Track(black ? Black(Stereo().frames[i]) : Stereo().frames[i]);
    if (black) {
      EXPECT_EQ(result.state, TrackingState::kLost);
      EXPECT_THAT(result.reason, HasSubstr("only 0 features"));
    } else {
      EXPECT_EQ(result.state, TrackingState::kTracking) << "frame " << i << ": " << result.reason;
    }
  }
  const Trajectory estimate = FrameTrajectory(odometry.map());
  EXPECT_EQ(estimate.size(), Stereo().frames.size() - 1);
  EXPECT_LT(EndError(Stereo().truth, estimate, false), 0.02 * PathLength(Stereo().truth));
  EXPECT_EQ(odometry.map().keyframe(odometry.map().KeyframeIds().back()).piece, 0);
}

TEST(Odometry, LongWithNothingOfTheMapInViewStartsANewPiece) {
  OdometryOptions options;
  options.relocalize_s = 0.35;
  Odometry odometry(options, Stereo().rig);
  for (std::size_t i = 0; i < Stereo().frames.size(); ++i) {
    const bool elsewhere = i >= 10 && i < 20;
    odometry.Track(elsewhere ? Snow(Stereo().frames[i]) : Stereo().frames[i]);
  }
  EXPECT_EQ(odometry.map().keyframe(odometry.map().KeyframeIds().back()).piece, 1);
  EXPECT_EQ(FramePieces(odometry.map()), (std::vector<int>{1, 0}));
  EXPECT_EQ(FrameTrajectory(odometry.map(), 0).size(), 10U);
  EXPECT_EQ(FrameTrajectory(odometry.map(), 1).size(), Stereo().frames.size() - 20);
  EXPECT_EQ(FrameIndices(odometry.map(), 1).front(), 20);
  EXPECT_EQ(FrameTrajectory(odometry.map()).size(), Stereo().frames.size() - 20) << "the larger piece";
}

TEST(Odometry, DarknessLosesNoPlace) {
  OdometryOptions options;
  options.relocalize_s = 0.35;
  Odometry odometry(options, Stereo().rig);
  for (std::size_t i = 0; i < Stereo().frames.size(); ++i) {
    const bool dark = i >= 10 && i < 15;
    odometry.Track(dark ? Black(Stereo().frames[i]) : Stereo().frames[i]);
  }
  EXPECT_EQ(FramePieces(odometry.map()), std::vector<int>{0});
  EXPECT_EQ(FrameTrajectory(odometry.map()).size(), Stereo().frames.size() - 5);
}

TEST(Odometry, RelocalizesTheLostFrameAtAKeyframeThatShowsItsPlace) {
  OdometryOptions options;
  options.keyframe_inlier_ratio = 0.95;  // more keyframes than a lost frame is compared with by itself
  Odometry odometry(options, Stereo().rig);
  TrackAll(Stereo(), odometry);
  const int first = odometry.map().KeyframeIds().front();
  const TrackResult kept = odometry.RelocalizeAt(first);
  EXPECT_EQ(kept.state, TrackingState::kTracking) << "nothing is lost, nothing changes";
  InputFrame carried = Stereo().frames[1];
  carried.index = static_cast<std::int64_t>(Stereo().frames.size());
  carried.stamp_s = Stereo().frames.back().stamp_s + 0.1;
  ASSERT_EQ(odometry.Track(carried).state, TrackingState::kLost);
  EXPECT_EQ(odometry.RelocalizeAt(odometry.map().KeyframeIds().back()).state, TrackingState::kLost)
      << "not there";
  const TrackResult found = odometry.RelocalizeAt(first);
  ASSERT_EQ(found.state, TrackingState::kTracking) << found.reason;
  EXPECT_LT((found.T_world_camera.translation - Stereo().truth[1].pose.translation).norm(), 0.05);
  EXPECT_EQ(FrameTrajectory(odometry.map()).size(), Stereo().frames.size() + 1);
}

TEST(Odometry, FramesThatWereLostAreTrackedBackwardsOnceTheCameraIsFoundAgain) {
  OdometryOptions options;
  options.keyframe_inlier_ratio = 0.95;
  Odometry odometry(options, Stereo().rig);
  TrackAll(Stereo(), odometry);
  constexpr std::size_t kCarried = 4;
  for (std::size_t i = 0; i < kCarried; ++i) {
    InputFrame carried = Stereo().frames[kCarried - i];
    carried.index = static_cast<std::int64_t>(Stereo().frames.size() + i);
    carried.stamp_s = Stereo().frames.back().stamp_s + 0.1 * static_cast<double>(i + 1);
    ASSERT_EQ(odometry.Track(carried).state, TrackingState::kLost);
  }
  ASSERT_EQ(odometry.RelocalizeAt(odometry.map().KeyframeIds().front()).state, TrackingState::kTracking);
  const Trajectory all = FrameTrajectory(odometry.map());
  ASSERT_EQ(all.size(), Stereo().frames.size() + kCarried);
  for (std::size_t i = 0; i < kCarried; ++i) {
    const Pose& T = all[Stereo().frames.size() + i].pose;
    EXPECT_LT((T.translation - Stereo().truth[kCarried - i].pose.translation).norm(), 0.05) << i;
  }
}

TEST(Odometry, BlankImagesNeverStartAMap) {
  Odometry odometry(OdometryOptions(), Stereo().rig);
  for (std::size_t i = 0; i < 5; ++i) {
    const TrackResult result = odometry.Track(Black(Stereo().frames[i]));
    EXPECT_EQ(result.state, TrackingState::kInitializing);
    EXPECT_FALSE(result.reason.empty());
  }
  EXPECT_TRUE(odometry.map().KeyframeIds().empty());
  EXPECT_TRUE(FrameTrajectory(odometry.map()).empty());
}

TEST(Odometry, UnusableRigsAndOptionsAreRefused) {
  CameraRig rig = Stereo().rig;
  rig.baseline_m = 0;
  EXPECT_THROW(Odometry(OdometryOptions(), rig), InputError);
  rig = Stereo().rig;
  rig.calibrated = false;
  EXPECT_THROW(Odometry(OdometryOptions(), rig), InputError);
  OdometryOptions options;
  options.scale_factor = 0.5;
  EXPECT_THROW(Odometry(options, Stereo().rig), InputError);
}

}  // namespace
}  // namespace tutti
