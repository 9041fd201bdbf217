// Members that describe an image as a whole.
#include <gtest/gtest.h>

#include <filesystem>

#include "loopclosure/features/whole_image.h"
#include "tests/loopclosure/detector/two_laps.h"
#include "tests/loopclosure/detector/wall_walk.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/detector.h"

namespace tutti {
namespace {

constexpr int kPlaces = testing::kWallPlaces;

using testing::PlacesFound;
using testing::TwoWalks;

cv::Mat Along(int place, std::uint32_t wall = 77) { return testing::AlongWall(place, wall); }

// A twenty-fifth of the light, and the noise of the sensor: next to nothing is left for corners.
cv::Mat AtNight(const cv::Mat& image, std::uint64_t seed) {
  cv::Mat dark, noise(image.size(), CV_32F);
  image.convertTo(dark, CV_32F, 0.04, 4.0);
  cv::RNG random(seed);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 3.0);
  dark += noise;
  dark.convertTo(dark, CV_8U);
  return dark;
}

LoopDetectorOptions Options(const std::vector<std::string>& members) {
  LoopDetectorOptions options = testing::SmallOptions();
  options.members = members;
  options.rule = members.size() == 1 ? CombinationRule::kSingle : CombinationRule::kJoint;
  options.verification.enabled = false;
  options.threads = 1;
  return options;
}

TEST(DenseMember, FindsTheSecondLapAtNightAndTakesNothingFromTheOthers) {
  const auto night = [](int i) {
    cv::Mat large;  // so that noise is fine and shapes are not
    cv::resize(Along(i), large, cv::Size(), 3, 3);
    return AtNight(large, static_cast<std::uint64_t>(i));
  };
  const int corners = PlacesFound(TwoWalks(Options({"surf", "sift", "orb"}), 30, night));
  const int dense = PlacesFound(TwoWalks(Options({"hog"}), 30, night));
  const int together = PlacesFound(TwoWalks(Options({"surf", "sift", "orb", "hog"}), 30, night));
  EXPECT_GE(dense, 8);
  EXPECT_GE(corners, 20);
  EXPECT_GE(together, corners - 1);
}

TEST(DenseMember, SaysNothingOfPlacesThatItHasNotSeen) {
  const std::vector<LoopResult> results = TwoWalks(Options({"hog"}), 30, [](int i) { return Along(i, 78); });
  for (const LoopResult& result : results) EXPECT_FALSE(result.accepted) << result.query;
}

TEST(DenseMember, CostsNothingWhereItSitsOut) {
  LoopDetectorOptions with = testing::SmallOptions();
  with.members = {"orb", "mute"};
  with.external_members = with.dense_members = {"mute"};
  LoopDetectorOptions without = testing::SmallOptions();
  without.members = {"orb"};
  LoopDetector a(with), b(without);
  int found_with = 0, found_without = 0;
  for (int i = 0; i < 30; ++i) {
    LoopQuery query;
    query.id = i;
    query.image = testing::WalkImage(i, 18);
    const LoopResult alone = b.Detect(query);
    query.member_features["mute"].descriptors = cv::Mat::zeros(1, 8, CV_32F);
    const LoopResult result = a.Detect(query);
    EXPECT_FALSE(result.members[1].took_part);
    ASSERT_TRUE(!result.accepted || result.verification.candidate == i - 18) << i;
    found_with += result.accepted ? 1 : 0;
    found_without += alone.accepted ? 1 : 0;
  }
  EXPECT_GE(found_with, found_without);
  EXPECT_GE(found_without, 5);
}

class SavedDense : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Rehearsal, SavedDense, ::testing::Bool());

TEST_P(SavedDense, GoesOnExactly) {
  const std::filesystem::path folder = testing::FreshFolder();
  LoopDetectorOptions options = Options({"orb", "hog"});
  options.wm_limit = 25;
  options.rehearsal = GetParam();
  LoopDetector saved(options);
  const auto see = [](LoopDetector& detector, int begin, int end) {
    std::vector<LoopResult> results;
    for (int i = begin; i < end; ++i) {
      const cv::Mat place = Along(i % kPlaces - (i % 7 == 3 ? 1 : 0));  // now and then the same again
      results.push_back(detector.Detect(i < kPlaces ? place : testing::SeenAgain(place), i));
    }
    return results;
  };
  see(saved, 1, 50);
  saved.Save(folder / "places.tutti");
  LoopDetector loaded(options);
  loaded.Load(folder / "places.tutti");
  testing::ExpectEqual(see(saved, 50, 70), see(loaded, 50, 70));
}

TEST(DenseMember, LivesInAFileThatOutlivesTheProcess) {
  const std::filesystem::path folder = testing::FreshFolder();
  LoopDetectorOptions options = Options({"orb", "hog"});
  options.wm_limit = 30;
  options.ltm_file = (folder / "memory.sqlite").string();
  {
    LoopDetector detector(options);
    for (int i = 0; i < kPlaces; ++i) detector.Detect(Along(i), i);
    EXPECT_GT(detector.NumLongTerm(), 0u);
  }
  LoopDetector detector(options);
  EXPECT_EQ(detector.LastId(), kPlaces - 1);
  // It begins where the memory still knows the wall; what lies further on comes back.
  int found = 0, retrieved = 0;
  for (int i = 20; i < kPlaces; ++i) {
    const LoopResult result = detector.Detect(testing::SeenAgain(Along(i)), kPlaces + i);
    EXPECT_EQ(result.warning, "");
    retrieved += static_cast<int>(result.retrieved.size());
    if (result.accepted && std::abs(result.candidate - i) <= 1) ++found;
  }
  EXPECT_GE(found, 8);
  EXPECT_GT(retrieved, 0);
  options.members = {"orb"};
  EXPECT_THROW(LoopDetector another(options), InputError);
}

TEST(DenseMember, LocatesOneImageByItself) {
  LoopDetector detector(Options({"hog"}));
  for (int i = 0; i < kPlaces; ++i) detector.Detect(Along(i), i);
  LoopQuery query;
  query.image = testing::SeenAgain(Along(12));
  EXPECT_EQ(detector.Locate(query).candidate, 12);
}

TEST(DenseMember, WorksWithStandardisedEvidence) {
  LoopDetectorOptions options = Options({"orb", "hog"});
  options.rule = CombinationRule::kMean;
  options.evidence.kind = EvidenceKind::kStandardised;
  EXPECT_NO_THROW(TwoWalks(options, 10, [](int i) { return testing::SeenAgain(Along(i)); }));
}

TEST(DenseMember, HardImagesNeverThrow) {
  LoopDetector detector(Options({"hog"}));
  const std::vector<cv::Mat> images = {cv::Mat(),
                                       cv::Mat::ones(1, 1, CV_8UC1),
                                       cv::Mat(120, 160, CV_8UC1, cv::Scalar(9)),
                                       cv::Mat(7, 900, CV_8UC1, cv::Scalar(9)),
                                       testing::TexturedImage(1),
                                       testing::TexturedImage(2, 2500, 1600)};
  for (int i = 0; i < 30; ++i) {
    LoopResult result;
    EXPECT_NO_THROW(result = detector.Detect(images[static_cast<std::size_t>(i) % images.size()], i));
    EXPECT_TRUE(result.accepted || !result.reason.empty());
  }
}

TEST(DenseMember, AloneHasNothingForTheGeometryAndSaysSo) {
  LoopDetectorOptions options = Options({"hog"});
  options.verification.enabled = true;
  const std::vector<LoopResult> results =
      TwoWalks(options, 30, [](int i) { return testing::SeenAgain(Along(i)); });
  EXPECT_FALSE(results.back().accepted);
  ASSERT_TRUE(results.back().proposed);
  EXPECT_NE(results.back().reason.find("verification.enabled: false"), std::string::npos);
}

TEST(DenseMember, OfTheCallersOwnFindsLoopsAndMisuseIsRefused) {
  LoopDetectorOptions options = Options({"mine"});
  options.external_members = options.dense_members = {"mine"};
  LoopDetector detector(options);
  LoopQuery query;
  int found = 0;
  for (int i = 0; i < kPlaces + 20; ++i) {
    query.id = i;
    const cv::Mat image = i < kPlaces ? Along(i) : testing::SeenAgain(Along(i - kPlaces));
    query.member_features["mine"].descriptors = 3 * DescribeByGradients(image);  // of any length
    const LoopResult result = detector.Detect(query);
    if (i >= kPlaces && result.accepted && std::abs(result.candidate - (i - kPlaces)) <= 1) ++found;
  }
  EXPECT_GE(found, 12);
  Features& mine = query.member_features["mine"];
  const cv::Mat good = mine.descriptors;
  const std::vector<cv::Mat> wrong = {cv::Mat::ones(2, good.cols, CV_32F), cv::Mat::ones(1, good.cols, CV_8U),
                                      cv::Mat::ones(1, good.cols + 1, CV_32F),
                                      cv::Mat(1, good.cols, CV_32F, cv::Scalar(NAN))};
  ++query.id;
  for (const cv::Mat& bad : wrong) {
    mine.descriptors = bad;
    EXPECT_THROW(detector.Detect(query), InputError);
  }
  mine.descriptors = good;
  mine.keypoints.resize(1);
  EXPECT_THROW(detector.Detect(query), InputError);
  mine = Features();
  EXPECT_NO_THROW(detector.Detect(query));  // sits out
}

TEST(DenseMember, NaiveHasNoUseForIt) {
  LoopDetectorOptions options;
  options.members = {"orb", "hog"};
  options.rule = CombinationRule::kNaive;
  EXPECT_NE(options.Validate().find("'hog' has none"), std::string::npos);
}

TEST(GradientDescriptor, KnowsNoLightAndLeavesOutWhatIsMasked) {
  const cv::Mat image = Along(3);
  const cv::Mat plain = DescribeByGradients(image);
  ASSERT_EQ(plain.cols, 432);
  EXPECT_NEAR(cv::norm(plain), 1.0, 1e-5);
  EXPECT_GT(plain.dot(DescribeByGradients(0.5 * image + cv::Scalar(60))), 0.98);
  EXPECT_LT(plain.dot(DescribeByGradients(Along(30))), 0.95);
  EXPECT_TRUE(DescribeByGradients(cv::Mat()).empty());
  EXPECT_TRUE(DescribeByGradients(cv::Mat(48, 64, CV_8UC1, cv::Scalar(7))).empty());
  cv::Mat mask(image.size(), CV_8UC1, cv::Scalar(255));
  mask(cv::Rect(0, 80, 160, 40)) = 0;
  cv::Mat other = image.clone();
  other(cv::Rect(0, 80, 160, 40)) = cv::Scalar(200);
  const cv::Mat a = DescribeByGradients(image, mask), b = DescribeByGradients(other, mask);
  EXPECT_NEAR(cv::norm(a - b), 0.0, 1e-6);
}

}  // namespace
}  // namespace tutti
