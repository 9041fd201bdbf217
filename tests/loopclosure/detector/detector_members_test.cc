// Members that the library does not have: a caller's own features, and registered kinds.
#include <gtest/gtest.h>

#include <opencv2/features2d.hpp>

#include "tests/loopclosure/detector/two_laps.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/loopclosure/features.h"

namespace tutti {
namespace {

// A caller's own features: ORB's on the image, under another name.
Features OwnFeatures(const cv::Mat& image) {
  Features features;
  cv::ORB::create(200)->detectAndCompute(image, cv::noArray(), features.keypoints, features.descriptors);
  return features;
}

TEST(LoopDetector, ACallersOwnFeaturesAreAMember) {
  LoopDetectorOptions options;
  options.members = {"mine"};
  options.external_members = {"mine"};
  options.rule = CombinationRule::kSingle;
  options.stm_size = 3;
  LoopDetector detector(options);
  int found = 0;
  for (int i = 0; i < 20; ++i) {
    const cv::Mat place = testing::TexturedImage(static_cast<std::uint32_t>(i % 12));
    LoopQuery query = testing::Query(i, i < 12 ? place : testing::SeenAgain(place));
    query.member_features["mine"] = OwnFeatures(query.image);
    query.image = cv::Mat();  // not needed
    const LoopResult result = detector.Detect(query);
    if (result.accepted) {
      EXPECT_EQ(result.verification.candidate, i - 12);
      ++found;
    }
  }
  EXPECT_GE(found, 4);
}

// What CheckQuery knows nothing of: query_check_test.cc has the rest.
TEST(LoopDetector, MemberFeaturesOfAnotherTypeThanBeforeAreRefusedAndChangeNothing) {
  LoopDetectorOptions options;
  options.members = {"mine", "orb"};
  options.external_members = {"mine"};
  LoopDetector detector(options);
  const cv::Mat image = testing::TexturedImage(1);
  EXPECT_THROW(detector.Detect(image, 0), InputError);  // "mine" is missing
  EXPECT_EQ(detector.NumLocations(), 0u);
  LoopQuery query = testing::Query(0, image);
  query.member_features["mine"] = OwnFeatures(image);
  EXPECT_NO_THROW(detector.Detect(query));
  query.id = 1;
  query.member_features["mine"].descriptors.convertTo(query.member_features["mine"].descriptors, CV_32F);
  EXPECT_THROW(detector.Detect(query), InputError);  // another type than before
  query.member_features["mine"] = {};
  EXPECT_NO_THROW(detector.Detect(query));  // none at all: sits this image out
  EXPECT_EQ(detector.NumLocations(), 2u);
}

TEST(LoopDetector, AnEnsembleOfFiveWithARegisteredFeature2D) {
  RegisterFeatureType("small_orb", [](cv::Size, int features) {
    return cv::ORB::create(features, 1.4f, 4, 15, 0, 2, cv::ORB::FAST_SCORE, 21);
  });
  EXPECT_THROW(RegisterFeatureType("small_orb", [](cv::Size, int) { return cv::Ptr<cv::Feature2D>(); }),
               InputError);
  EXPECT_THROW(RegisterFeatureType("surf", [](cv::Size, int) { return cv::Ptr<cv::Feature2D>(); }),
               InputError);
  LoopDetectorOptions options;
  options.members = {"surf", "sift", "orb", "akaze", "small_orb"};
  const std::vector<LoopResult> results = testing::TwoLaps(options, 14, 5);
  int found = 0;
  for (const LoopResult& result : results) found += result.accepted ? 1 : 0;
  EXPECT_GE(found, 3);
  ASSERT_EQ(results.back().members.size(), 5u);
  EXPECT_EQ(results.back().members[4].name, "small_orb");
  EXPECT_GT(results.back().members[4].features, 50);
}

}  // namespace
}  // namespace tutti
