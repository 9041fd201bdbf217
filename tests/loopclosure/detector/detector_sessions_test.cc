// A detector that is shown another recording, and one that is shown the places of another detector.
#include <gtest/gtest.h>

#include "tests/loopclosure/detector/two_laps.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::Query;
using testing::SeenAgain;
using testing::TexturedImage;

LoopDetectorOptions SessionOptions() {
  LoopDetectorOptions options = testing::SmallOptions();
  options.stm_size = 8;
  options.extraction.features = 300;
  return options;
}

TEST(DetectorSessions, WhatWasSeenLastIsACandidateForTheNextRecording) {
  LoopDetector one(SessionOptions()), two(SessionOptions());
  constexpr int kPlaces = 18, kNew = 13;  // places 13 and 14 are in short-term memory
  for (int i = 0; i < kPlaces; ++i) {
    one.Detect(Query(i, TexturedImage(static_cast<std::uint32_t>(i))));
    two.Detect(Query(i, TexturedImage(static_cast<std::uint32_t>(i))));
  }
  two.BeginSession();
  const LoopQuery again = Query(100, SeenAgain(TexturedImage(kNew)));
  EXPECT_FALSE(one.Locate(again).accepted);
  const LoopResult found = two.Locate(again);
  EXPECT_TRUE(found.accepted) << found.reason;
  EXPECT_EQ(found.candidate, kNew);
  LoopResult last;
  for (int i = 0; i < 3; ++i)
    last = two.Detect(Query(100 + i, SeenAgain(TexturedImage(static_cast<std::uint32_t>(kNew + i)))));
  EXPECT_TRUE(last.accepted) << last.reason;
  EXPECT_EQ(last.candidate, kNew + 2);
}

TEST(DetectorSessions, ThePlacesOfOneDetectorAreRecognisedByAnother) {
  LoopDetectorOptions options = SessionOptions();
  options.wm_limit = 6;  // some are in long-term memory
  LoopDetector one(SessionOptions()), two(options);
  constexpr int kPlaces = 18, kAgain = 6;
  for (int i = 0; i < kPlaces; ++i) {
    one.Detect(Query(i, TexturedImage(static_cast<std::uint32_t>(i))));
    two.Detect(Query(i, i < kAgain ? SeenAgain(TexturedImage(static_cast<std::uint32_t>(i)))
                                   : TexturedImage(static_cast<std::uint32_t>(100 + i))));
  }
  ASSERT_GT(two.NumLongTerm(), 0u);
  const std::vector<LoopPlace> places = two.Places();
  ASSERT_EQ(places.size(), static_cast<std::size_t>(kPlaces));
  one.BeginSession();
  int found = 0;
  for (const LoopPlace& place : places) {
    LoopQuery query;
    query.id = 1000 + place.id;
    query.member_features = place.member_features;
    const LoopResult result = one.Detect(query);
    if (!result.accepted) continue;
    EXPECT_EQ(result.candidate, place.id);
    ++found;
  }
  EXPECT_GE(found, kAgain / 2);
}

TEST(DetectorSessions, DenseMembersHaveNoPlacesToShow) {
  LoopDetectorOptions options = SessionOptions();
  options.members = {"orb", "hog"};
  LoopDetector detector(options);
  EXPECT_THROW(detector.Places(), InputError);
}

}  // namespace
}  // namespace tutti
