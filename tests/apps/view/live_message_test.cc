#include "apps/view/live_message.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace tutti::view {
namespace {

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
  // As it is, and twice as wide as what is sent.
  EXPECT_EQ(nlohmann::json::parse(LiveMessage(NewsOf(320, trail)))["frame"]["tracks"],
            nlohmann::json::parse("[[110.0, 64.0, 100.0, 60.0]]"));
  EXPECT_EQ(nlohmann::json::parse(LiveMessage(NewsOf(1280, trail)))["frame"]["tracks"],
            nlohmann::json::parse("[[55.0, 32.0, 50.0, 30.0]]"));
}

TEST(LiveMessage, AFrameWithoutAPoseHasNoTracks) {
  EXPECT_EQ(nlohmann::json::parse(LiveMessage(NewsOf(320, {})))["frame"]["tracks"], nlohmann::json::array());
}

TEST(LiveMessage, SaysHowManyFramesAreToCome) {
  LiveNews news = NewsOf(320, {});
  news.total = 1700;
  EXPECT_EQ(nlohmann::json::parse(LiveMessage(news))["total"], 1700);
}

TEST(LiveMessage, PlacesHaveTheirRecordingAndSpotsTheirKeyframe) {
  LiveNews news = NewsOf(320, {});
  news.sessions = 3;
  news.only_located = true;
  news.places = std::make_shared<const std::vector<LivePlace>>(std::vector<LivePlace>{{4, 100007, 0, 1, {}}});
  news.spots = {{1, LiveSpot::Kind::kRecognised, 20, 4, {1, 2, 3}},
                {2, LiveSpot::Kind::kBeyond, 21, -1, {4, 5, 6}}};
  const auto json = nlohmann::json::parse(LiveMessage(news));
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

}  // namespace
}  // namespace tutti::view
