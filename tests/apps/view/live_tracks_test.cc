#include "apps/view/live_tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace tutti::view {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST(LiveTracks, TailIsWhereTheLandmarkWasNewestFirst) {
  LiveTrail trail;
  ExtendTrail({{7, {1, 1}}, {8, {50, 50}}}, &trail);
  ExtendTrail({{7, {2, 1}}}, &trail);
  ExtendTrail({{8, {52, 50}}, {7, {3, 1}}}, &trail);
  const std::vector<LiveTrack> tracks = TracksOf(trail, 100);
  ASSERT_THAT(tracks, SizeIs(2));
  EXPECT_THAT(tracks[0], ElementsAre(cv::Point2f(52, 50), cv::Point2f(50, 50)));  // not seen in between
  EXPECT_THAT(tracks[1], ElementsAre(cv::Point2f(3, 1), cv::Point2f(2, 1), cv::Point2f(1, 1)));
}

TEST(LiveTracks, LandmarksThatTheNewestFrameDoesNotShowAreLeftOut) {
  LiveTrail trail;
  ExtendTrail({{1, {5, 5}}}, &trail);
  ExtendTrail({{2, {6, 6}}}, &trail);
  EXPECT_THAT(TracksOf(trail, 100), ElementsAre(ElementsAre(cv::Point2f(6, 6))));
  EXPECT_THAT(TracksOf({}, 100), IsEmpty());
}

TEST(LiveTracks, TailsEndAfterAFewFrames) {
  LiveTrail trail;
  for (int frame = 0; frame < 40; ++frame) ExtendTrail({{3, cv::Point2f(float(frame), 0)}}, &trail);
  const std::vector<LiveTrack> tracks = TracksOf(trail, 100);
  ASSERT_THAT(tracks, SizeIs(1));
  EXPECT_THAT(tracks[0], SizeIs(kTrailFrames));
  EXPECT_EQ(tracks[0].front().x, 39);
  EXPECT_EQ(tracks[0].back().x, 40 - float(kTrailFrames));
}

TEST(LiveTracks, TheSameLandmarksAreShownInTheNextFrame) {
  const auto frame = [](int count, float moved) {
    std::vector<SeenLandmark> seen;
    seen.reserve(static_cast<std::size_t>(count));
    for (int l = 0; l < count; ++l) seen.push_back({3 * l + 1, {float(l) + moved, 0}});
    return seen;
  };
  const auto shown = [](const std::vector<LiveTrack>& tracks, float moved) {
    std::set<int> landmarks;
    for (const LiveTrack& track : tracks) landmarks.insert(int(track.front().x - moved));
    return landmarks;
  };
  LiveTrail trail;
  ExtendTrail(frame(1000, 0), &trail);
  const std::vector<LiveTrack> before = TracksOf(trail, 250);
  ExtendTrail(frame(997, 0.5F), &trail);  // a few are gone
  const std::vector<LiveTrack> after = TracksOf(trail, 250);
  EXPECT_LE(before.size(), 250U);
  EXPECT_GE(before.size(), 200U);
  std::set<int> both = shown(before, 0);
  for (const int landmark : shown(after, 0.5F)) EXPECT_EQ(both.count(landmark), 1U) << landmark;
  EXPECT_GE(after.size() + 3, before.size());
}

}  // namespace
}  // namespace tutti::view
