#include "tutti/loopclosure/detector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "tests/loopclosure/detector/two_laps.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/evaluation.h"

namespace tutti {
namespace {

class EveryRule : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Rules, EveryRule,
                         ::testing::Values("mean", "product", "majority", "naive", "surf", "sift", "orb"));

TEST_P(EveryRule, FindsTheSecondLapAndNothingBefore) {
  LoopDetectorOptions options;
  SetRule(GetParam(), options);
  EXPECT_EQ(RuleName(options), GetParam());
  const std::vector<LoopResult> results = testing::TwoLaps(options);
  int found = 0;
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (i < 18) {
      EXPECT_FALSE(results[i].accepted) << i;
      EXPECT_FALSE(results[i].reason.empty()) << i;
    } else if (results[i].accepted) {
      EXPECT_EQ(results[i].candidate, static_cast<std::int64_t>(i) - 18);
      EXPECT_EQ(results[i].verification.candidate, results[i].candidate);
      EXPECT_EQ(results[i].reason, "");
      ++found;
    }
  }
  // The product of the members' "new place" stays high until all of them are sure: it finds loops late.
  EXPECT_GE(found, GetParam() == "product" ? 1 : 5);
}

TEST(LoopDetector, TheSameForAnyNumberOfThreadsAndBesideAnotherDetector) {
  LoopDetectorOptions one;
  one.threads = 1;
  LoopDetectorOptions two;
  two.threads = 2;
  std::vector<LoopResult> beside;
  std::thread other([&] { beside = testing::TwoLaps(two, 14, 3); });
  const std::vector<LoopResult> a = testing::TwoLaps(one, 14, 3);
  other.join();
  testing::ExpectEqual(a, beside);
}

TEST(LoopDetector, HardImagesNeverThrow) {
  LoopDetectorOptions options;
  options.stm_size = 2;
  LoopDetector detector(options);
  const cv::Mat texture = testing::TexturedImage(1);
  cv::Mat colour, deep;
  cv::cvtColor(texture, colour, cv::COLOR_GRAY2BGR);
  texture.convertTo(deep, CV_16U, 100);
  const std::vector<cv::Mat> images = {texture,
                                       cv::Mat(),
                                       cv::Mat(240, 320, CV_8UC1, cv::Scalar(0)),
                                       cv::Mat::ones(1, 1, CV_8UC1),
                                       cv::Mat(7, 900, CV_8UC1, cv::Scalar(9)),
                                       colour,
                                       deep,
                                       testing::TexturedImage(2, 2500, 1600),
                                       texture};
  std::int64_t id = 0;
  for (const cv::Mat& image : images) {
    LoopResult result;
    EXPECT_NO_THROW(result = detector.Detect(testing::Query(id++, image)));
    EXPECT_TRUE(result.hypothesis >= 0 && result.hypothesis <= 1);
    EXPECT_TRUE(result.accepted || !result.reason.empty());
  }
  EXPECT_EQ(detector.NumLocations(), images.size());
}

TEST(LoopDetector, AMemberWithoutFeaturesSitsOut) {
  LoopDetectorOptions options;
  options.stm_size = 2;
  LoopDetector detector(options);
  LoopResult result;
  for (int i = 0; i < 6; ++i) {
    LoopQuery query = testing::Query(i, testing::TexturedImage(static_cast<std::uint32_t>(i)));
    query.member_features["surf"] = Features();
    result = detector.Detect(query);
  }
  EXPECT_FALSE(result.members[0].took_part);
  EXPECT_TRUE(result.members[1].took_part);
  EXPECT_TRUE(result.members[2].took_part);
  EXPECT_GE(result.candidate, 0);
}

TEST(LoopDetector, UnusableOptionsAreRefusedWithTheFieldsName) {
  LoopDetectorOptions options;
  options.members = {"surf", "orbb"};
  try {
    LoopDetector detector(options);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("did you mean 'orb'"), std::string::npos) << error.what();
  }
  options.members = {"orb", "orb"};
  EXPECT_NE(options.Validate(), "");
  options.members = {"orb"};
  EXPECT_EQ(options.Validate(), "");
  options.vocabulary.nndr = 2;
  EXPECT_NE(options.Validate().find("nndr"), std::string::npos);
  EXPECT_THROW(SetRule("meen", options), InputError);
}

// query_check_test.cc has all else that a query must be.
TEST(LoopDetector, WhatIsRefusedChangesNothing) {
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
  detector.Detect(query);
  query.id = 7;
  query.features.descriptors = cv::Mat::zeros(3, 64, CV_32F);
  EXPECT_THROW(detector.Detect(query), InputError);
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

TEST(LoopDetector, RehearsalMergesAStandingCamera) {
  LoopDetectorOptions options;
  options.rehearsal = true;
  LoopDetector detector(options);
  for (int i = 0; i < 6; ++i) detector.Detect(testing::Query(i, testing::TexturedImage(1)));
  EXPECT_EQ(detector.NumLocations(), 1u);
  detector.Detect(testing::Query(6, testing::TexturedImage(2)));
  EXPECT_EQ(detector.NumLocations(), 2u);
  EXPECT_NO_THROW(detector.AddLink(3, 6));
}

TEST_P(EveryRule, LocatesAKnownPlaceByOneImageAndChangesNothing) {
  constexpr int kPlaces = 16;
  LoopDetectorOptions options = testing::SmallOptions();
  SetRule(GetParam(), options);
  LoopDetector asked(options), not_asked(options);
  testing::Walk(asked, 0, kPlaces, kPlaces);
  testing::Walk(not_asked, 0, kPlaces, kPlaces);
  for (const int place : {2, 9}) {
    LoopQuery query;
    query.image = testing::WalkImage(kPlaces + place, kPlaces);
    const LoopResult result = asked.Locate(query);
    EXPECT_TRUE(result.accepted) << result.reason;
    EXPECT_EQ(result.candidate, place);
  }
  LoopQuery elsewhere;
  elsewhere.image = testing::TexturedImage(1000, 240, 180);
  const LoopResult unknown = asked.Locate(elsewhere);
  EXPECT_FALSE(unknown.accepted);
  EXPECT_FALSE(unknown.reason.empty());
  EXPECT_EQ(asked.NumLocations(), not_asked.NumLocations());
  testing::ExpectEqual(testing::Walk(asked, kPlaces, kPlaces + 4, kPlaces),
                       testing::Walk(not_asked, kPlaces, kPlaces + 4, kPlaces));
}

TEST(LoopDetector, LocatesNothingBeforeThereIsAnything) {
  const LoopDetector detector(testing::SmallOptions());
  LoopQuery query;
  query.image = testing::WalkImage(0, 16);
  const LoopResult result = detector.Locate(query);
  EXPECT_FALSE(result.accepted);
  EXPECT_FALSE(result.reason.empty());
}

TEST(LoopDetector, ALoopThatIsTakenBackLeavesNoTraceInTheFilter) {
  constexpr int kPlaces = 16;
  LoopDetectorOptions never = testing::SmallOptions();
  never.link_threshold = 1.0;  // no probability reaches it
  LoopDetector linked(testing::SmallOptions());
  LoopDetector unlinked(testing::SmallOptions());
  LoopDetector not_linked(never);
  for (LoopDetector* detector : {&linked, &unlinked, &not_linked}) {
    testing::Walk(*detector, 0, kPlaces + 4, kPlaces);
  }
  int loops = 0;
  for (int i = kPlaces + 4; i < 2 * kPlaces; ++i) {
    const cv::Mat image = testing::WalkImage(i, kPlaces);
    const LoopResult result = unlinked.Detect(image, i);
    linked.Detect(image, i);
    not_linked.Detect(image, i);
    if (!result.accepted) continue;
    ++loops;
    unlinked.Unlink(result.query, result.candidate);
  }
  ASSERT_GT(loops, 3);
  // Locations of the first lap, and their twins of the second, are places of their own again.
  const cv::Mat next = testing::WalkImage(2 * kPlaces, kPlaces);
  const double with_links = linked.Detect(next, 2 * kPlaces).posterior;
  EXPECT_NE(with_links, not_linked.Detect(next, 2 * kPlaces).posterior);
  EXPECT_NE(with_links, unlinked.Detect(next, 2 * kPlaces).posterior);
  EXPECT_NO_THROW(unlinked.Unlink(3, 1 << 20));
  EXPECT_NO_THROW(unlinked.Unlink(3, 4));
}

TEST(LoopDetector, TheProbabilityDecidesAndIsGivenForRefusedLoopsToo) {
  constexpr int kPlaces = 16;
  LoopDetectorOptions strict = testing::SmallOptions();
  strict.loop_threshold = 1.0;
  LoopDetector detector(strict);
  int verified = 0;
  for (const LoopResult& result : testing::Walk(detector, 0, 2 * kPlaces, kPlaces)) {
    EXPECT_FALSE(result.accepted);
    if (!result.verification.accepted) continue;
    ++verified;
    EXPECT_GT(result.probability, 0.5);
    EXPECT_NE(result.reason.find("probability"), std::string::npos) << result.reason;
  }
  EXPECT_GT(verified, 5);
}

TEST(LoopDetector, KeepsThePosteriorOnlyWhenAsked) {
  LoopDetectorOptions options;
  options.stm_size = 2;
  options.keep_posterior = true;
  LoopDetector detector(options);
  LoopResult result;
  for (int i = 0; i < 6; ++i)
    result = detector.Detect(testing::Query(i, testing::TexturedImage(static_cast<std::uint32_t>(i))));
  ASSERT_EQ(result.posterior_by_location.size(), 4u);
  double sum = 0;
  for (const auto& [id, p] : result.posterior_by_location) sum += p;
  EXPECT_NEAR(sum, result.hypothesis, 1e-9);
}

TEST(LoopDetector, KeepsTheEvidenceOfEveryCandidateOnlyWhenAsked) {
  constexpr int kPlaces = 8;
  LoopDetectorOptions options = testing::SmallOptions();
  options.rehearsal = false;
  for (const char* rule : {"mean", "naive", "orb"}) {
    for (const MemoryKind memory : {MemoryKind::kShared, MemoryKind::kPerMember}) {
      SetRule(rule, options);
      options.memory = memory;
      options.keep_evidence = false;
      LoopDetector silent(options);
      const LoopResult without = testing::Walk(silent, 0, kPlaces + 1, kPlaces).back();
      EXPECT_TRUE(without.posterior_by_location.empty());
      options.keep_evidence = true;
      LoopDetector detector(options);
      const LoopResult result = testing::Walk(detector, 0, kPlaces + 1, kPlaces).back();
      EXPECT_EQ(result.hypothesis, without.hypothesis);  // looking on changes nothing
      ASSERT_EQ(result.posterior_by_location.size(),
                static_cast<std::size_t>(kPlaces + 1 - options.stm_size));
      for (std::size_t k = 0; k < result.members.size(); ++k) {
        const MemberOpinion& member = result.members[k];
        EXPECT_TRUE(without.members[k].evidence.empty());
        ASSERT_EQ(member.evidence.size(), result.posterior_by_location.size());
        double sum = 0;
        for (std::size_t i = 0; i < member.evidence.size(); ++i) {
          EXPECT_EQ(member.evidence[i].location, result.posterior_by_location[i].first);
          if (member.evidence[i].score == 0) {
            EXPECT_LE(member.evidence[i].likelihood, 1);
          }
          sum += member.evidence[i].posterior;
        }
        EXPECT_NEAR(sum, member.hypothesis, 1e-9);
        // Image kPlaces shows place 0 again: the best raw score, and the one that stands out.
        const auto best = std::max_element(member.evidence.begin(), member.evidence.end(),
                                           [](const auto& a, const auto& b) { return a.score < b.score; });
        EXPECT_EQ(best->location, 0) << rule << " " << member.name;
        EXPECT_GT(best->likelihood, 1);
      }
    }
  }
}

TEST(LoopDetector, TheJointFiltersEvidenceIsTheWeightedSumOfTheMembers) {
  constexpr int kPlaces = 8;
  LoopDetectorOptions options = testing::SmallOptions();
  SetRule("joint", options);
  options.rehearsal = false;
  LoopDetector silent(options);
  const LoopResult without = testing::Walk(silent, 0, kPlaces + 1, kPlaces).back();
  EXPECT_TRUE(without.evidence.empty());
  options.keep_evidence = true;
  LoopDetector detector(options);
  const LoopResult result = testing::Walk(detector, 0, kPlaces + 1, kPlaces).back();
  EXPECT_EQ(result.hypothesis, without.hypothesis);
  ASSERT_EQ(result.evidence.size(), result.posterior_by_location.size());
  ASSERT_FALSE(result.evidence.empty());
  for (std::size_t i = 0; i < result.evidence.size(); ++i) {
    EXPECT_EQ(result.evidence[i].location, result.posterior_by_location[i].first);
    EXPECT_EQ(result.evidence[i].posterior, result.posterior_by_location[i].second);
    EXPECT_GT(result.evidence[i].likelihood, 0);
    EXPECT_GE(result.evidence[i].score, 0);
  }
  // Image kPlaces shows place 0 again.
  const auto best = std::max_element(result.evidence.begin(), result.evidence.end(),
                                     [](const auto& a, const auto& b) { return a.score < b.score; });
  EXPECT_EQ(best->location, 0);
  EXPECT_GT(best->likelihood, 1);
  SetRule("mean", options);
  LoopDetector apart(options);
  EXPECT_TRUE(testing::Walk(apart, 0, kPlaces + 1, kPlaces).back().evidence.empty());
}

TEST(LoopDetector, AMemberThatSitsAnImageOutHasNoEvidence) {
  LoopDetectorOptions options = testing::SmallOptions();
  options.keep_evidence = true;
  LoopDetector detector(options);
  testing::Walk(detector, 0, 5, 5);
  const LoopResult result = detector.Detect(cv::Mat(180, 240, CV_8UC1, cv::Scalar(80)), 5);
  for (const MemberOpinion& member : result.members) EXPECT_TRUE(member.evidence.empty());
  EXPECT_TRUE(result.evidence.empty());
  EXPECT_EQ(result.posterior_by_location.size(), 3u);
}

TEST(LoopDetector, CorridorReachesThePapersClassWithoutAFalseLoop) {
  TUTTI_REQUIRE_DATA(folder, "corridor");
  LoopDetector detector{LoopDetectorOptions()};
  std::vector<LoopObservation> observations;
  for (int i = 0; i < 84; ++i) {
    const cv::Mat image =
        cv::imread((folder / (std::to_string(i + 1) + ".jpg")).string(), cv::IMREAD_GRAYSCALE);
    ASSERT_FALSE(image.empty());
    observations.push_back(Observe(detector.Detect(testing::Query(i, image))));
  }
  const LoopGroundTruth truth = ReadLoopMatrix(folder / "ground_truth.bmp", 84);
  const LoopEvaluation result = EvaluateVerified(observations, truth);
  EXPECT_EQ(result.rows_with_loop, 44);
  EXPECT_GE(result.recall_at_100_precision, 0.97);
  EXPECT_GE(result.at_default_threshold.recall, 0.90);
  EXPECT_EQ(result.false_positives, 0);
}

TEST(LoopDetector, KittiLoopIsFoundAndNothingElse) {
  TUTTI_REQUIRE_DATA(folder, "kitti_00_head");
  LoopDetectorOptions options;
  LoopDetector detector(options);
  const LoopGroundTruth truth = ReadLoopMatrix(folder / "loop_gt_stride5.png", 340);
  int found = 0;
  // The part that is driven again, some of the way between, and the second drive.
  for (int i = 20; i < 328; i = i == 60 ? 290 : i + 1) {
    char name[32];
    std::snprintf(name, sizeof name, "image_0/%06d.webp", i * 5);
    const cv::Mat image = cv::imread((folder / name).string(), cv::IMREAD_GRAYSCALE);
    ASSERT_FALSE(image.empty()) << name;
    const LoopResult result = detector.Detect(testing::Query(i, image));
    if (!result.accepted) continue;
    EXPECT_NE(truth.At(i, static_cast<int>(result.candidate)), LoopLabel::kNone) << i;
    found += truth.HasLoop(i) ? 1 : 0;
  }
  EXPECT_GE(found, 13);
}

}  // namespace
}  // namespace tutti
