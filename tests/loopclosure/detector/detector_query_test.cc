// What a query may be: misuse is refused before anything changes, and a mask is heeded.
#include <gtest/gtest.h>

#include "tests/loopclosure/detector/two_laps.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/detector.h"

namespace tutti {
namespace {

TEST(LoopDetector, MisuseIsAnError) {
  LoopDetector detector{LoopDetectorOptions()};
  const cv::Mat image = testing::TexturedImage(1);
  detector.Detect(testing::Query(5, image));
  EXPECT_THROW(detector.Detect(testing::Query(5, image)), InputError);
  EXPECT_THROW(detector.Detect(testing::Query(4, image)), InputError);
  EXPECT_THROW(detector.AddLink(5, 77), InputError);

  LoopQuery query = testing::Query(6, image);
  query.features.keypoints.resize(3);
  EXPECT_THROW(detector.Detect(query), InputError);
  query.features.descriptors = cv::Mat::zeros(3, 32, CV_8U);
  query.features.points.resize(2);
  EXPECT_THROW(detector.Detect(query), InputError);
  query.features.points.clear();
  detector.Detect(query);
  query.id = 7;
  query.features.descriptors = cv::Mat::zeros(3, 64, CV_32F);
  EXPECT_THROW(detector.Detect(query), InputError);
  LoopQuery depth = testing::Query(8, image);
  depth.depth_m = cv::Mat::zeros(5, 5, CV_32F);
  EXPECT_THROW(detector.Detect(depth), InputError);
  EXPECT_EQ(detector.NumLocations(), 2u);
}

TEST(LoopDetector, FeaturesUnderTheMaskDoNotExist) {
  LoopDetectorOptions options;
  options.stm_size = 1;
  options.loop_threshold = 0.9;  // which features it has matters here, not how probable half an image is
  LoopDetector detector(options);
  const cv::Mat image = testing::TexturedImage(1);
  LoopQuery query = testing::Query(0, image);
  query.features.keypoints = {
      {cv::Point2f(40, 100), 8}, {cv::Point2f(200, 100), 8}, {cv::Point2f(210, 90), 8}};
  query.features.descriptors = (cv::Mat_<std::uint8_t>(3, 2) << 0, 0, 255, 255, 15, 240);
  const LoopResult all = detector.Detect(query);
  query.mask = cv::Mat::zeros(image.size(), CV_8U);
  query.mask(cv::Rect(160, 0, 160, 240)) = 255;  // the right half is to be seen
  LoopResult masked;
  for (query.id = 1; query.id < 4; ++query.id) masked = detector.Detect(query);
  for (std::size_t k = 0; k < masked.members.size(); ++k) {
    EXPECT_GT(masked.members[k].features, 0);
    EXPECT_LT(masked.members[k].features, all.members[k].features);
  }
  ASSERT_TRUE(masked.accepted) << masked.reason;
  int of_the_caller = 0;
  for (const VerifiedMatch& match : masked.verification.inlier_matches) {
    EXPECT_GE(match.query.x, 159);
    EXPECT_GE(match.candidate.x, masked.verification.candidate == 0 ? 0 : 159);
    of_the_caller += match.query_feature >= 0 ? 1 : 0;
    EXPECT_NE(match.query_feature, 0);
    if (match.query_feature >= 0) {
      EXPECT_EQ(match.query, query.features.keypoints[static_cast<std::size_t>(match.query_feature)].pt);
    }
  }
  EXPECT_EQ(of_the_caller, 2);
}

}  // namespace
}  // namespace tutti
