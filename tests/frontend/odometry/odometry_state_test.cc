// OdometryFile: saved and loaded at any frame, it goes on as if nothing had been.
#include <gtest/gtest.h>

#include <future>

#include "tests/frontend/odometry/odometry_rider.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::ExpectEqual;
using testing::kElsewhere;
using testing::kFrames;
using testing::kLoop;
using testing::Rider;
using testing::Sections;
using testing::SectionsOf;
using testing::WithoutTimes;

void ExpectSame(const TrackResult& a, const TrackResult& b) {
  EXPECT_EQ(a.state, b.state);
  EXPECT_EQ(a.reason, b.reason);
  EXPECT_EQ(a.T_world_camera.Matrix(), b.T_world_camera.Matrix());
  EXPECT_EQ(a.features, b.features);
  EXPECT_EQ(a.inliers, b.inliers);
  EXPECT_EQ(a.keyframe, b.keyframe);
}

// What others see of an odometry.
void ExpectSame(const Odometry& a, const Odometry& b) {
  ASSERT_EQ(a.map().KeyframeIds(), b.map().KeyframeIds());
  for (const int id : a.map().KeyframeIds()) {
    const KeyframeView x = ViewOf(a.map(), id), y = ViewOf(b.map(), id);
    EXPECT_EQ(x.T_world_camera.Matrix(), y.T_world_camera.Matrix()) << id;
    EXPECT_EQ(x.landmarks, y.landmarks);
    EXPECT_EQ(x.map_piece, y.map_piece);
    ASSERT_EQ(x.points.size(), y.points.size());
    for (std::size_t f = 0; f < x.points.size(); ++f) {
      EXPECT_TRUE(x.points[f] == y.points[f] || (x.points[f].hasNaN() && y.points[f].hasNaN()));
      EXPECT_EQ(x.keypoints[f].pt, y.keypoints[f].pt);
      EXPECT_EQ(x.keypoints[f].size, y.keypoints[f].size);
      EXPECT_EQ(x.keypoints[f].angle, y.keypoints[f].angle);
      EXPECT_EQ(x.keypoints[f].response, y.keypoints[f].response);
      EXPECT_EQ(x.keypoints[f].octave, y.keypoints[f].octave);
      EXPECT_EQ(x.keypoints[f].class_id, y.keypoints[f].class_id);
    }
    EXPECT_TRUE(x.descriptors.empty() == y.descriptors.empty() &&
                (x.descriptors.empty() || cv::norm(x.descriptors, y.descriptors, cv::NORM_L1) == 0));
  }
  EXPECT_EQ(FramePieces(a.map()), FramePieces(b.map()));
  for (const int piece : FramePieces(a.map())) {
    const Trajectory x = FrameTrajectory(a.map(), piece), y = FrameTrajectory(b.map(), piece);
    ASSERT_EQ(x.size(), y.size());
    for (std::size_t i = 0; i < x.size(); ++i) EXPECT_EQ(x[i].pose.Matrix(), y[i].pose.Matrix()) << i;
  }
  EXPECT_EQ(Covisibility(a.map(), 1), Covisibility(b.map(), 1));
}

class OdometryState : public ::testing::TestWithParam<Sensor> {
 protected:
  fs::path file_ = testing::FreshFolder() / "odometry.tutti";
};

std::string SensorName(const ::testing::TestParamInfo<Sensor>& info) { return WordOf(info.param); }
INSTANTIATE_TEST_SUITE_P(All, OdometryState, ::testing::Values(Sensor::kMono, Sensor::kStereo, Sensor::kRgbd),
                         SensorName);

TEST_P(OdometryState, SavedAndLoadedAfterEachFrameItIsTheOneThatNeverWas) {
  Rider plain(GetParam(), false), handed_on(GetParam());
  std::map<TrackingState, int> states;
  int keyframes = 0;
  while (plain.next() < kFrames) {
    const TrackResult expected = plain.Next();
    ExpectSame(handed_on.Next(), expected);
    ++states[expected.state];
    keyframes += expected.keyframe >= 0 ? 1 : 0;
    const Sections before = SectionsOf(handed_on.odometry());
    handed_on = handed_on.Again(file_);
    ExpectEqual(SectionsOf(handed_on.odometry()), before);
    ExpectEqual(WithoutTimes(before), WithoutTimes(SectionsOf(plain.odometry())));
    if (::testing::Test::HasFailure()) FAIL() << "after frame " << plain.next() - 1;
  }
  EXPECT_TRUE(plain.entered()) << "the adjustment";
  EXPECT_TRUE(handed_on.entered());
  EXPECT_GE(FramePieces(plain.odometry().map()).size(), 2U);
  EXPECT_GE(keyframes, 5);
  EXPECT_GT(states[TrackingState::kLost], 2);
  EXPECT_GT(states[TrackingState::kTracking], 20);
  plain.Finish();
  handed_on.Finish();
  ExpectSame(plain.odometry(), handed_on.odometry());
}

TEST_P(OdometryState, SavedOnceItGoesOnAsTheOneThatWentOn) {
  for (const std::size_t k : {std::size_t(1), kLoop + 1, kElsewhere + 5}) {
    Rider run(GetParam());
    while (run.next() < k) run.Next();
    Rider again = run.Again(file_, false);
    EXPECT_EQ(run.odometry().Report().stage_ms, again.odometry().Report().stage_ms);
    while (run.next() < kFrames) ExpectSame(again.Next(), run.Next());
    ExpectEqual(WithoutTimes(SectionsOf(again.odometry())), WithoutTimes(SectionsOf(run.odometry())));
    run.Finish();
    again.Finish();
    ExpectSame(run.odometry(), again.odometry());
  }
}

TEST_P(OdometryState, ACopyIsSavedOnAnotherThreadWhileTheOriginalGoesOn) {
  Rider run(GetParam());
  while (run.next() < kLoop) run.Next();
  const Sections expected = SectionsOf(run.odometry());
  for (int i = 0; i < 4; ++i) {
    auto saved =
        std::async(std::launch::async, [copy = std::make_unique<Odometry>(run.odometry())]() mutable {
          Sections sections = SectionsOf(*copy);
          copy.reset();
          return sections;
        });
    const Sections now = i == 0 ? expected : SectionsOf(Odometry(run.odometry()));
    run.Next();
    run.Next();
    ExpectEqual(saved.get(), now);
  }
}

}  // namespace
}  // namespace tutti
