#include "loopclosure/detector/ensemble.h"

#include <gtest/gtest.h>

#include "tests/loopclosure/detector/shown_state.h"
#include "tests/loopclosure/features/textured_image.h"

namespace tutti::internal {
namespace {

using tutti::testing::Query;
using tutti::testing::TexturedImage;

LoopDetectorOptions WithThreads(int threads) {
  LoopDetectorOptions options = tutti::testing::SmallOptions();
  options.threads = threads;
  return options;
}

TEST(Ensemble, EveryMemberSeesWordsAndKnowsThemAgainWithoutLearning) {
  Ensemble ensemble(WithThreads(1));
  const LoopQuery query = Query(0, TexturedImage(3));
  const std::vector<Features> features = ensemble.Extract(query);
  const std::vector<SeenWords> unknown = ensemble.Recognise(features, query.image.size());
  for (const SeenWords& words : unknown) EXPECT_EQ(words.size(), 0);
  const std::vector<SeenWords> learnt = ensemble.Quantise(features, query.image.size());
  const std::vector<SeenWords> known = ensemble.Recognise(features, query.image.size());
  ASSERT_EQ(learnt.size(), ensemble.members().size());
  for (std::size_t k = 0; k < learnt.size(); ++k) {
    EXPECT_GT(learnt[k].size(), 50);
    EXPECT_EQ(learnt[k].words.size(), static_cast<std::size_t>(features[k].descriptors.rows));
    EXPECT_EQ(learnt[k].cells.size(), learnt[k].words.size());
    EXPECT_GT(known[k].size(), learnt[k].size() / 2);
    EXPECT_GT(ensemble.members()[k].num_words(), 0);
  }
}

TEST(Ensemble, TheSameForOneAndThreeThreads) {
  Ensemble one(WithThreads(1));
  Ensemble three(WithThreads(3));
  for (int i = 0; i < 3; ++i) {
    const LoopQuery query = Query(i, TexturedImage(static_cast<std::uint32_t>(i)));
    const std::vector<SeenWords> a = one.Quantise(one.Extract(query), query.image.size());
    const std::vector<SeenWords> b = three.Quantise(three.Extract(query), query.image.size());
    for (std::size_t k = 0; k < a.size(); ++k) EXPECT_EQ(a[k].words, b[k].words) << i << " " << k;
  }
}

TEST(Ensemble, APlainImageOrNoneHasNoWords) {
  for (const cv::Mat& image : {cv::Mat(180, 240, CV_8UC1, cv::Scalar(128)), cv::Mat()}) {
    Ensemble ensemble(WithThreads(1));
    const std::vector<Features> features = ensemble.Extract(Query(0, image));
    for (const SeenWords& words : ensemble.Quantise(features, image.size())) EXPECT_EQ(words.size(), 0);
  }
}

TEST(Ensemble, NothingIsSeenUnderTheMask) {
  const Ensemble ensemble(WithThreads(1));
  LoopQuery query = Query(0, TexturedImage(1));
  query.mask = cv::Mat::zeros(query.image.size(), CV_8U);
  query.mask(cv::Rect(160, 0, 160, 240)) = 255;
  for (const Features& features : ensemble.Extract(query)) {
    EXPECT_GT(features.keypoints.size(), 0u);
    for (const cv::KeyPoint& keypoint : features.keypoints) EXPECT_GE(keypoint.pt.x, 159.5f);
  }
}

TEST(Ensemble, FeaturesThatTheCallerGivesAreCopiedAndNothingIsExtracted) {
  LoopDetectorOptions options = tutti::testing::OneMember();
  const Ensemble ensemble(options);
  LoopQuery query = Query(0, cv::Mat());
  query.member_features["orb"].keypoints = {{cv::Point2f(40, 100), 8}};
  query.member_features["orb"].descriptors = cv::Mat::zeros(1, 32, CV_8U);
  const std::vector<Features> features = ensemble.Extract(query);
  query.member_features["orb"].descriptors = 7;  // writes into the caller's matrix
  ASSERT_EQ(features.front().descriptors.rows, 1);
  EXPECT_EQ(features.front().descriptors.at<std::uint8_t>(0, 5), 0);
}

TEST(Ensemble, KnowsWhetherAllItsMembersAreDense) {
  LoopDetectorOptions options;
  EXPECT_FALSE(Ensemble(options).all_dense());
  options.members = {"hog"};
  options.rule = CombinationRule::kSingle;
  EXPECT_TRUE(Ensemble(options).all_dense());
}

}  // namespace
}  // namespace tutti::internal
