// What the page is sent: the message, and the tracks in it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "apps/view/live_server.h"

namespace tutti::view {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// The message that says this.
nlohmann::json Message(const LiveNews& news) { return nlohmann::json::parse(LiveMessage(news)); }

LiveNews NewsOf(int width, LiveTrail trail) {
  LiveNews news;
  news.places = std::make_shared<const std::vector<LivePlace>>();
  news.loops = std::make_shared<const std::vector<LiveLoop>>();
  news.frame.number = 1;
  news.frame.image = cv::Mat(width / 2, width, CV_8UC1, cv::Scalar(90));
  news.frame.trail = std::move(trail);
  return news;
}

TEST(LiveMessage, TracksAreInPixelsOfThePictureThatIsSent) {
  LiveTrail trail;
  ExtendTrail({{4, {100, 60}}}, &trail);
  ExtendTrail({{4, {110, 64}}}, &trail);
  // The images are as wide as what is sent, and twice as wide.
  EXPECT_EQ(Message(NewsOf(320, trail))["frame"]["tracks"],
            nlohmann::json::parse("[[110.0, 64.0, 100.0, 60.0]]"));
  EXPECT_EQ(Message(NewsOf(1280, trail))["frame"]["tracks"],
            nlohmann::json::parse("[[55.0, 32.0, 50.0, 30.0]]"));
}

TEST(LiveMessage, AFrameWithoutAPoseHasNoTracks) {
  EXPECT_EQ(Message(NewsOf(320, {}))["frame"]["tracks"], nlohmann::json::array());
}

TEST(LiveMessage, PlacesHaveTheirRecordingAndSpotsTheirKeyframe) {
  LiveNews news = NewsOf(320, {});
  news.sessions = 3;
  news.only_located = true;
  news.total = 1700;
  news.places = std::make_shared<const std::vector<LivePlace>>(std::vector<LivePlace>{{4, 100007, 0, 1, {}}});
  news.spots = {{1, LiveSpot::Kind::kRecognised, 20, 4, {1, 2, 3}},
                {2, LiveSpot::Kind::kBeyond, 21, -1, {4, 5, 6}}};
  const auto json = Message(news);
  EXPECT_EQ(json["total"], 1700) << "frames that are to come";
  EXPECT_EQ(json["sessions"], 3);
  EXPECT_EQ(json["only_located"], true);
  EXPECT_EQ(json["places"][0][4], 1);
  EXPECT_EQ(json["spots"],
            nlohmann::json::parse(
                R"([["recognised", 20, 4, [1.0, 2.0, 3.0]], ["beyond", 21, -1, [4.0, 5.0, 6.0]]])"));
}

TEST(LiveMessage, IsOneLineWhateverTheTextsHold) {
  LiveNews news = NewsOf(320, {});
  news.events.push_back({});
  news.events.back().text = "line\n\ndata: forged \xff\xfe";
  EXPECT_EQ(LiveMessage(news).find('\n'), std::string::npos);
}

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
