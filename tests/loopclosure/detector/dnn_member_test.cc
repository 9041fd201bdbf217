// The member dnn within the ensemble.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/loopclosure/detector/two_laps.h"
#include "tests/loopclosure/detector/wall_walk.h"
#include "tests/loopclosure/features/small_networks.h"
#include "tests/support/error_of.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/detector.h"

namespace tutti {
namespace {

using ::testing::AllOf;
using testing::AlongWall;
using testing::ErrorOf;
using ::testing::HasSubstr;
using testing::kWallPlaces;

LoopDetectorOptions DnnMemberOptions(const std::vector<std::string>& members,
                                     const std::filesystem::path& model) {
  LoopDetectorOptions options = testing::SmallOptions();
  options.members = members;
  options.rule = members.size() == 1 ? CombinationRule::kSingle : CombinationRule::kJoint;
  options.verification.enabled = false;
  options.dnn.model = model.string();
  options.dnn.width = 64;
  options.dnn.height = 48;
  return options;
}

std::vector<LoopResult> TwoWalksOfDnn(const LoopDetectorOptions& options, int images_again) {
  return testing::TwoWalks(options, images_again, [](int i) { return testing::SeenAgain(AlongWall(i)); });
}

class DnnMember : public testing::SmallNetworks {};

TEST_F(DnnMember, FindsTheSecondLapAloneAndAmongOthers) {
  const std::vector<LoopResult> alone = TwoWalksOfDnn(DnnMemberOptions({"dnn"}, Network("edges")), 30);
  EXPECT_GE(testing::PlacesFound(alone), 15);
  EXPECT_EQ(alone.back().members.front().name, "dnn");
  EXPECT_TRUE(alone.back().members.front().took_part);
  EXPECT_EQ(alone.back().members.front().features, 1);
  const int corners = testing::PlacesFound(TwoWalksOfDnn(DnnMemberOptions({"orb"}, ""), 30));
  EXPECT_GE(testing::PlacesFound(TwoWalksOfDnn(DnnMemberOptions({"orb", "dnn"}, Network("edges")), 30)),
            corners - 1);
}

TEST_F(DnnMember, SameResultsForAnyNumberOfThreads) {
  LoopDetectorOptions options = DnnMemberOptions({"orb", "dnn", "hog"}, Network("edges"));
  options.threads = 1;
  const std::vector<LoopResult> one = TwoWalksOfDnn(options, 12);
  options.threads = 2;
  testing::ExpectEqual(one, TwoWalksOfDnn(options, 12));
}

TEST_F(DnnMember, SavedMemoriesAreForTheSameNetwork) {
  const LoopDetectorOptions options = DnnMemberOptions({"orb", "dnn"}, Network("means"));
  LoopDetector detector(options);
  for (int i = 0; i < 20; ++i) detector.Detect(AlongWall(i), i);
  const std::filesystem::path file = folder() / "memory";
  detector.Save(file);

  LoopDetector same(options);
  same.Load(file);
  for (int i = 20; i < 30; ++i) {
    testing::ExpectEqual({detector.Detect(AlongWall(i), i)}, {same.Detect(AlongWall(i), i)});
  }
  LoopDetectorOptions resized = options;
  resized.dnn.width = 80;
  for (const LoopDetectorOptions& other : {DnnMemberOptions({"orb", "dnn"}, Network("three")),
                                           DnnMemberOptions({"orb", "dnn"}, Network("other")), resized}) {
    LoopDetector another(other);
    EXPECT_THAT(ErrorOf([&] { another.Load(file); }),
                AllOf(HasSubstr("another configuration"), HasSubstr("dnn (4 values of network")));
    EXPECT_EQ(another.LastId(), -1);  // as it was
  }
}

TEST_F(DnnMember, LongTermMemoriesAreForTheSameNetwork) {
  LoopDetectorOptions options = DnnMemberOptions({"dnn"}, Network("edges"));
  options.ltm_file = (folder() / "ltm.sqlite").string();
  options.wm_limit = 15;
  {
    LoopDetector detector(options);
    for (int i = 0; i < kWallPlaces; ++i) detector.Detect(AlongWall(i), i);
    EXPECT_GT(detector.NumLongTerm(), 5u);
  }
  LoopDetectorOptions other = options;
  other.dnn.model = Network("means").string();
  EXPECT_THAT(ErrorOf([&] { LoopDetector detector(other); }), HasSubstr("another configuration"));
  LoopDetector again(options);
  EXPECT_EQ(again.LastId(), kWallPlaces - 1);
  again.Detect(AlongWall(3), kWallPlaces);
}

TEST_F(DnnMember, WhatTheNetworkCantDoLeavesTheDetectorAsItWas) {
  EXPECT_THAT(ErrorOf([&] { LoopDetector detector(DnnMemberOptions({"dnn"}, Network("map"))); }),
              HasSubstr("is a vector"));
  LoopDetector detector(DnnMemberOptions({"orb", "dnn"}, Network("huge")));
  EXPECT_THAT(ErrorOf([&] { detector.Detect(AlongWall(0), 0); }), HasSubstr("not a finite number"));
  EXPECT_EQ(detector.LastId(), -1);
  EXPECT_EQ(detector.NumLocations(), 0u);
}

TEST_F(DnnMember, DescriptorsOfTheCallersOwnAreAsLong) {
  LoopDetector detector(DnnMemberOptions({"dnn"}, Network("means")));
  LoopQuery query;
  query.member_features["dnn"].descriptors = cv::Mat::ones(1, 5, CV_32F);
  EXPECT_THAT(ErrorOf([&] { detector.Detect(query); }), HasSubstr("5 values"));
  query.member_features["dnn"].descriptors = cv::Mat::ones(1, 4, CV_32F);
  EXPECT_NO_THROW(detector.Detect(query));
}

TEST(DnnOptions, SayWhatIsWrong) {
  LoopDetectorOptions options;
  EXPECT_EQ(options.Validate(), "");
  options.members = {"orb", "dnn"};
  EXPECT_THAT(options.Validate(), AllOf(HasSubstr("dnn.model is empty"), HasSubstr("ONNX file")));
  options.external_members = options.dense_members = {"dnn"};  // the caller's own, under the same name
  EXPECT_EQ(options.Validate(), "");
  const auto problem = [](void (*change)(DnnOptions&)) {
    LoopDetectorOptions changed;
    change(changed.dnn);
    return changed.Validate();
  };
  EXPECT_EQ(problem([](DnnOptions& o) { o.width = 15; }), "dnn.width must be 16 to 4096 [px], not 15");
  EXPECT_EQ(problem([](DnnOptions& o) { o.height = 4097; }), "dnn.height must be 16 to 4096 [px], not 4097");
  EXPECT_THAT(problem([](DnnOptions& o) { o.mean[2] = NAN; }), HasSubstr("dnn.mean"));
  EXPECT_THAT(problem([](DnnOptions& o) { o.scale = 0; }), HasSubstr("dnn.scale"));
  EXPECT_THAT(problem([](DnnOptions& o) { o.stddev[0] = -1; }), HasSubstr("dnn.stddev"));
}

}  // namespace
}  // namespace tutti
