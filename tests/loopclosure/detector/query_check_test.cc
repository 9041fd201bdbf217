#include "loopclosure/detector/ensemble.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "tests/loopclosure/detector/shown_state.h"
#include "tests/loopclosure/features/textured_image.h"

namespace tutti::internal {
namespace {

using tutti::testing::RefusalOf;

TEST(CheckId, IdsGrowFromZeroOn) {
  EXPECT_NO_THROW(CheckId(0, -1));
  EXPECT_NO_THROW(CheckId(std::numeric_limits<std::int64_t>::max(), 5));
  EXPECT_NE(RefusalOf([] { CheckId(-1, -1); }).find("must not be negative"), std::string::npos);
  EXPECT_NE(RefusalOf([] { CheckId(5, 5); }).find("the one before was 5"), std::string::npos);
  EXPECT_THROW(CheckId(std::numeric_limits<std::int64_t>::min(), 5), InputError);
}

class CheckedQuery : public ::testing::Test {
 protected:
  // Expects a query that is spoilt like this to be refused with this word, and not before it is spoilt.
  void ExpectRefusal(const std::function<void(LoopQuery&)>& spoil, const char* word) const {
    LoopQuery query = tutti::testing::Query(1, image_);
    query.features.keypoints = {{cv::Point2f(40, 100), 8}, {cv::Point2f(200, 100), 8}};
    query.features.descriptors = cv::Mat::zeros(2, 32, CV_8U);
    EXPECT_NO_THROW(Check(query));
    spoil(query);
    const std::string refusal = RefusalOf([&] { Check(query); });
    EXPECT_NE(refusal.find(word), std::string::npos) << "'" << refusal << "' instead of " << word;
    EXPECT_EQ(refusal.rfind("location 1: ", 0), 0u) << refusal;
  }
  void Check(const LoopQuery& query) const { CheckQuery(query, ensemble_.members(), before_); }

  const cv::Mat image_ = tutti::testing::TexturedImage(1);
  Ensemble ensemble_{LoopDetectorOptions()};
  CallersDescriptors before_{CV_8U, 32};
};

TEST_F(CheckedQuery, ImagesAndRegionsMustFitEachOther) {
  ExpectRefusal([](LoopQuery& q) { q.mask = cv::Mat::ones(5, 5, CV_8U); }, "as large as the image");
  ExpectRefusal([&](LoopQuery& q) { q.mask = cv::Mat::ones(image_.size(), CV_32F); }, "CV_8UC1");
  ExpectRefusal([](LoopQuery& q) { q.depth_m = cv::Mat::zeros(5, 5, CV_32F); }, "depth_m");
  for (const int type : {CV_32FC1, CV_8UC(128), CV_8UC4, CV_8UC2, CV_16UC3, CV_16SC1, CV_64FC1})
    ExpectRefusal([&](LoopQuery& q) { q.image = cv::Mat::zeros(image_.size(), type); },
                  "image must be CV_8UC1, CV_8UC3");
  ExpectRefusal([](LoopQuery& q) { q.cameras = {{0, 0, 0, 9}}; }, "empty");
  ExpectRefusal([](LoopQuery& q) { q.cameras = {{0, 0, 9, 9}, {300, 0, 100, 240}}; }, "inside of the image");
  ExpectRefusal([](LoopQuery& q) { q.cameras = {{2000000000, 0, 2000000000, 240}}; }, "inside of the image");
  ExpectRefusal([](LoopQuery& q) { q.cameras = {{0, 0, 160, 240}, {159, 0, 160, 240}}; }, "overlap");
  ExpectRefusal([](LoopQuery& q) { q.camera = PinholeCamera(); }, "");
  ExpectRefusal(
      [](LoopQuery& q) {
        q.cameras = {{0, 0, 160, 240}, {160, 0, 160, 240}};
        q.camera = PinholeCamera();
        q.camera->width = 320;
        q.camera->height = 240;
        q.camera->fx = q.camera->fy = 200;
      },
      "no common camera");
}

TEST_F(CheckedQuery, TheCallersFeaturesAreOneOfEachAndOfOneKind) {
  ExpectRefusal([](LoopQuery& q) { q.features.keypoints.pop_back(); }, "1 keypoints but 2 descriptor rows");
  ExpectRefusal([](LoopQuery& q) { q.features.points.resize(1); }, "1 points");
  ExpectRefusal([](LoopQuery& q) { q.features.descriptors = cv::Mat::zeros(2, 32, CV_16U); }, "CV_8U");
  ExpectRefusal([](LoopQuery& q) { q.features.descriptors = cv::Mat::zeros(2, 64, CV_8U); }, "than before");
  ExpectRefusal([](LoopQuery& q) { q.features.descriptors = cv::Mat::zeros(2, 32, CV_32F); }, "than before");
  for (const float pixel : {std::numeric_limits<float>::quiet_NaN(), -2e6f}) {
    ExpectRefusal([&](LoopQuery& q) { q.features.keypoints[1].pt.y = pixel; }, "a keypoint is not a finite");
  }
}

TEST_F(CheckedQuery, APriorIsFiniteAndHasAWidth) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const auto refused = [&](PosePrior prior) {
    ExpectRefusal([&](LoopQuery& q) { q.pose_prior = prior; }, "pose_prior");
  };
  refused({{0, nan, 0}, 0, 5.0, 0.05});
  for (const double sigma : {0.0, -1.0, nan, infinity}) refused({{0, 0, 0}, 0, sigma, 0.05});
  for (const double drift : {-1.0, nan, infinity}) refused({{0, 0, 0}, 0, 5.0, drift});
}

TEST_F(CheckedQuery, FeaturesOfMembersAreOfMembersThatAreThere) {
  ExpectRefusal([](LoopQuery& q) { q.member_features["yours"] = {}; }, "'yours', which is not in");
  ExpectRefusal([](LoopQuery& q) { q.member_features["orb"].keypoints.resize(1); }, "orb: 1 keypoints");
  LoopDetectorOptions options;
  options.members = {"mine", "hog"};
  options.external_members = {"mine"};
  ensemble_ = Ensemble(options);
  LoopQuery query = tutti::testing::Query(1, image_);
  EXPECT_NE(RefusalOf([&] { Check(query); }).find("'mine' is external"), std::string::npos);
  query.member_features["mine"] = {};  // none at all
  EXPECT_NO_THROW(Check(query));
  query.member_features["hog"].keypoints.resize(1);
  EXPECT_NE(RefusalOf([&] { Check(query); }).find("as a whole"), std::string::npos);
}

}  // namespace
}  // namespace tutti::internal
