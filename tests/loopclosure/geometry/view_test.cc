// What is kept of an image for verification.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "core/state_archive.h"
#include "loopclosure/geometry/verification.h"
#include "tests/support/plain_camera.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr int kX = 30, kY = 20;  // the pixel that is looked at

// An image without any depth, and one feature in it.
class DepthOfAFeature : public ::testing::Test {
 protected:
  DepthOfAFeature() {
    query_.camera = testing::PlainCamera(500);
    query_.depth_m = cv::Mat(480, 640, CV_32FC1, cv::Scalar(0));
    options_.min_depth_m = 0.5;
    options_.max_depth_m = 8;
  }

  // The 3x3 pixels around a pixel, row by row.
  void SetDepths(const std::vector<float>& values, int x = kX, int y = kY) {
    ASSERT_EQ(values.size(), 9u);
    for (int i = 0; i < 9; ++i) {
      const cv::Point at(x + i % 3 - 1, y + i / 3 - 1);
      if (cv::Rect({0, 0}, query_.depth_m.size()).contains(at))
        query_.depth_m.at<float>(at) = values[static_cast<std::size_t>(i)];
    }
  }

  Eigen::Vector3f PointAt(float x, float y) const {
    Features features;
    features.keypoints.emplace_back(x, y, 7.0f);
    features.descriptors = cv::Mat::zeros(1, 32, CV_8U);
    const View view = MakeView(query_, {features}, options_);
    return view.members.at(0).points.at(0);
  }

  // 0 if it is unknown.
  float Depth() const {
    const Eigen::Vector3f point = PointAt(kX, kY);
    return point.allFinite() ? point.z() : 0.0f;
  }

  LoopQuery query_;
  VerificationOptions options_;
};

TEST_F(DepthOfAFeature, IsTheMedianOfThePixelsAroundIt) {
  query_.depth_m(cv::Rect(kX - 2, kY - 2, 5, 5)).setTo(7);  // what lies around those says nothing
  SetDepths({4.08f, 4.03f, 4.02f, 4.07f, 4.0f, 4.01f, 4.05f, 4.06f, 4.04f});
  EXPECT_EQ(Depth(), 4.04f);
}

TEST_F(DepthOfAFeature, NeedsFiveOfTheNinePixels) {
  SetDepths({2.01f, 0, 2.02f, 0, 2, 0, 0, 0, 2.03f});
  EXPECT_EQ(Depth(), 0) << "four";
  SetDepths({2.01f, 0, 2.02f, 0, 2, kNan, 2.04f, 0, 2.03f});
  EXPECT_EQ(Depth(), 2.02f) << "five";
  // The one at the feature itself is none of them for being there.
  SetDepths({2.01f, 2, 2.02f, 2, 0, 2, 2, 2, 2.03f});
  EXPECT_EQ(Depth(), 2);
}

TEST_F(DepthOfAFeature, IsUnknownAtTheEdgeOfAnObject) {
  SetDepths({2.00f, 2, 2, 2, 2, 2, 2, 2, 2.09f});
  EXPECT_EQ(Depth(), 2) << "4.5 % apart";
  SetDepths({2.00f, 2, 2, 2, 2, 2, 2, 2, 2.11f});
  EXPECT_EQ(Depth(), 0) << "5.5 % apart";
  constexpr float kFar = 2.103f;
  SetDepths({kFar, kFar, kFar, kFar, kFar, 2, kFar, kFar, kFar});
  EXPECT_EQ(Depth(), 0) << "5.15 % of the nearest, but less than 5 % of the others";
  SetDepths({1, 1, 1, 1, 1, 1, 5, 5, 5});
  EXPECT_EQ(Depth(), 0) << "something far beside something near";
}

TEST_F(DepthOfAFeature, CountsWhatLiesWithinTheRangeOfTheSensorAlone) {
  const float infinite = std::numeric_limits<float>::infinity();
  SetDepths({2, 2, 2, 2, 2, 0.4f, 9, infinite, -2});
  EXPECT_EQ(Depth(), 2);
  SetDepths({0.4f, 0.4f, 0.4f, 0.4f, 0.4f, 0.4f, 0.4f, 0.4f, 0.4f});
  EXPECT_EQ(Depth(), 0);
  SetDepths({9, 9, 9, 9, 9, 9, 9, 9, 9});
  EXPECT_EQ(Depth(), 0);
}

// Six pixels lie around one at a side of the image, four around one in a corner, which are too few.
TEST_F(DepthOfAFeature, AtTheBorderOfTheImageIsOfThePixelsThatAreThere) {
  const int right = query_.depth_m.cols - 1, bottom = query_.depth_m.rows - 1;
  const std::vector<float> wall(9, 3.0f);
  for (const cv::Point& side :
       {cv::Point(0, 50), cv::Point(50, 0), cv::Point(right, 50), cv::Point(50, bottom)}) {
    SetDepths(wall, side.x, side.y);
    EXPECT_EQ(PointAt(static_cast<float>(side.x), static_cast<float>(side.y)).z(), 3.0f) << side;
  }
  SetDepths(wall, right, bottom);
  EXPECT_FALSE(PointAt(static_cast<float>(right), static_cast<float>(bottom)).allFinite());
}

TEST_F(DepthOfAFeature, IsOfTheNearestPixelAndThePointLiesOnTheRayOfTheFeature) {
  SetDepths(std::vector<float>(9, 4.0f), kX, kY);
  const PinholeCamera& camera = *query_.camera;
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(kX - 0.4, kY + 0.4), Eigen::Vector2d(kX + 0.4, kY - 0.4)}) {
    const Eigen::Vector3f point = PointAt(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
    ASSERT_TRUE(point.allFinite());
    EXPECT_EQ(point.z(), 4.0f);
    EXPECT_LT((camera.Project(point.cast<double>()) - pixel).norm(), 1e-3);
  }
}

TEST_F(DepthOfAFeature, IsNotLookedUpWhereTheCallerKnowsThePointOrThereIsNoScale) {
  SetDepths(std::vector<float>(9, 4.0f));
  query_.features.keypoints = {cv::KeyPoint(kX, kY, 7.0f), cv::KeyPoint(kX, kY, 7.0f)};
  query_.features.descriptors = cv::Mat::zeros(2, 32, CV_8U);
  query_.features.points = {{1, 2, 3}, Eigen::Vector3d::Constant(std::nan(""))};
  const View view = MakeView(query_, {}, options_);
  ASSERT_EQ(view.caller.points.size(), 2u);
  EXPECT_EQ(view.caller.points[0], Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(view.caller.points[1].z(), 4.0f);
  query_.features.points.clear();
  query_.metric = false;
  EXPECT_TRUE(MakeView(query_, {}, options_).caller.points.empty());
}

TEST(View, TheCallersFeaturesKeepTheirNumbersWhereOthersAreMasked) {
  LoopQuery query;
  query.image = cv::Mat::zeros(100, 200, CV_8UC1);
  query.mask = cv::Mat(100, 200, CV_8UC1, cv::Scalar(255));
  query.mask.colRange(50, 100).setTo(0);
  for (const float x : {60.0f, 10.0f, 70.0f, 150.0f}) query.features.keypoints.emplace_back(x, 20.0f, 7.0f);
  query.features.descriptors = (cv::Mat_<float>(4, 1) << 0, 1, 2, 3);
  const View view = MakeView(query, {}, {});
  EXPECT_EQ(view.size, cv::Size(200, 100));
  EXPECT_EQ(view.caller.numbers, (std::vector<int>{1, 3}));
  ASSERT_EQ(view.caller.pixels.size(), 2u);
  EXPECT_EQ(view.caller.pixels[1].x, 150.0f);
  EXPECT_EQ(view.caller.descriptors.Unpacked().at<float>(1), 3.0f);
}

TEST(View, WithoutAnImageItsSizeIsTheCamerasOrReachesOverTheFeatures) {
  LoopQuery query;
  Features features;
  features.keypoints = {cv::KeyPoint(120.5f, 7.0f, 7.0f), cv::KeyPoint(3.0f, 80.0f, 7.0f)};
  features.descriptors = cv::Mat::zeros(2, 32, CV_8U);
  EXPECT_EQ(MakeView(query, {features}, {}).size, cv::Size(122, 81));
  query.camera = testing::PlainCamera(500);
  EXPECT_EQ(MakeView(query, {features}, {}).size, cv::Size(query.camera->width, query.camera->height));
}

using internal::ReadStateBytes;
using internal::StateBytes;

// Every third feature has no point.
View::Set ViewSetOf(int features, bool with_points) {
  View::Set set;
  if (features == 0) return set;
  cv::RNG random(static_cast<std::uint64_t>(features));
  for (int i = 0; i < features; ++i) {
    const float x = random.uniform(0.0f, 640.0f), y = random.uniform(0.0f, 480.0f);
    set.pixels.emplace_back(x, y);
    if (with_points && i % 3 == 1) {
      set.points.push_back(Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()));
    } else if (with_points) {
      set.points.emplace_back(x / 100, -y / 100, static_cast<float>(i) + 0.5f);
    }
  }
  cv::Mat descriptors(features, 32, CV_8U);
  random.fill(descriptors, cv::RNG::UNIFORM, 0, 256);
  set.descriptors = descriptors;
  return set;
}

View WholeView() {
  View view;
  view.id = 12345678901;
  view.size = {640, 480};
  view.metric = false;
  view.camera = testing::PlainCamera(500);
  view.camera->fy = 510;
  view.camera->distortion = Distortion::kRadTan;
  view.camera->coefficients = {-0.2, 0.1, 1e-3, -2e-3, 0.05};
  view.members = {ViewSetOf(7, true), ViewSetOf(8, true), ViewSetOf(0, false), ViewSetOf(25, false)};
  view.caller = ViewSetOf(9, true);
  return view;
}

View Again(const View& view) {
  View loaded;
  ReadStateBytes(StateBytes(view), "test", loaded);
  return loaded;
}

void ExpectSameSet(const View::Set& a, const View::Set& b) {
  EXPECT_EQ(a.pixels, b.pixels);
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_EQ(a.points[i].allFinite(), b.points[i].allFinite()) << i;
    if (a.points[i].allFinite()) {
      EXPECT_EQ(a.points[i], b.points[i]) << i;
    }
  }
  const cv::Mat descriptors = a.descriptors.Unpacked(), others = b.descriptors.Unpacked();
  ASSERT_EQ(descriptors.size(), others.size());
  if (descriptors.empty()) return;
  EXPECT_EQ(cv::norm(descriptors, others, cv::NORM_HAMMING), 0);
}

TEST(SavedView, EverythingComesBack) {
  const View view = WholeView(), again = Again(view);
  EXPECT_EQ(again.id, view.id);
  EXPECT_EQ(again.size, view.size);
  EXPECT_FALSE(again.metric);
  ASSERT_TRUE(again.camera.has_value());
  const PinholeCamera &a = *again.camera, &b = *view.camera;
  EXPECT_EQ(std::make_pair(a.width, a.height), std::make_pair(b.width, b.height));
  EXPECT_EQ((std::array{a.fx, a.fy, a.cx, a.cy}), (std::array{b.fx, b.fy, b.cx, b.cy}));
  EXPECT_EQ(a.distortion, b.distortion);
  EXPECT_EQ(a.coefficients, b.coefficients);
  ASSERT_EQ(again.members.size(), 4u);
  for (std::size_t m = 0; m < 4; ++m) ExpectSameSet(again.members[m], view.members[m]);
  ExpectSameSet(again.caller, view.caller);
  EXPECT_TRUE(again.caller.numbers.empty());
}

TEST(SavedView, OfAnImageWithoutCameraOrFeaturesComesBack) {
  View view;
  view.id = 0;
  view.size = {1, 1};
  const View again = Again(view);
  EXPECT_EQ(again.size, cv::Size(1, 1));
  EXPECT_TRUE(again.metric);
  EXPECT_FALSE(again.camera.has_value());
  EXPECT_TRUE(again.members.empty() && again.caller.pixels.empty() && again.cameras.empty());
}

TEST(SavedView, CutOffAnywhereItIsRefused) {
  View view = WholeView();
  view.cameras = {{0, 0, 320, 480}, {320, 0, 320, 480}};
  view.caller.numbers = {0, 1, 2, 3, 4, 5, 6, 7, 8};
  EXPECT_EQ(Again(view).cameras, view.cameras);
  EXPECT_EQ(Again(view).caller.numbers, view.caller.numbers);
  const std::string good = StateBytes(view);
  for (std::size_t length = 0; length < good.size(); length += 3) {
    View cut;
    EXPECT_THROW(ReadStateBytes(good.substr(0, length), "test", cut), InputError) << length;
  }
}

// What no image has, each beside what one may have.
TEST(SavedView, ImpossibleOnesAreRefused) {
  const auto refused = [](const auto& change) {
    View view = WholeView();
    change(view);
    try {
      Again(view);
    } catch (const InputError&) {
      return true;
    }
    return false;
  };
  EXPECT_FALSE(refused([](View& v) { v.size = {1, 1}; }));
  EXPECT_TRUE(refused([](View& v) { v.size = {0, 480}; }));
  EXPECT_TRUE(refused([](View& v) { v.size = {640, 0}; }));
  EXPECT_FALSE(refused([](View& v) { v.caller.pixels[3] = {View::kFarthestPixel, -View::kFarthestPixel}; }));
  EXPECT_TRUE(refused([](View& v) { v.caller.pixels[3].x = 1.01f * View::kFarthestPixel; }));
  EXPECT_TRUE(refused([](View& v) { v.members[1].pixels[3].y = -1.01f * View::kFarthestPixel; }));
  EXPECT_TRUE(refused([](View& v) { v.members[1].pixels[3].y = std::nanf(""); }));
  EXPECT_TRUE(refused([](View& v) { v.members[0].descriptors = v.members[1].descriptors; }));
  EXPECT_TRUE(refused([](View& v) { v.members[0].points.pop_back(); }));
  EXPECT_TRUE(refused([](View& v) { v.camera->fx = 0; }));
  EXPECT_FALSE(refused([](View& v) { v.caller.numbers = {4, 7, 8, 9, 10, 11, 12, 13, 14}; }));
  EXPECT_TRUE(refused([](View& v) { v.caller.numbers = {4}; }));
  EXPECT_TRUE(refused([](View& v) { v.caller.numbers = {4, -1, 8, 9, 10, 11, 12, 13, 14}; }));
  EXPECT_FALSE(refused([](View& v) { v.cameras = {{0, 0, 1, 1}}; }));
  EXPECT_TRUE(refused([](View& v) { v.cameras = {{-1, 0, 320, 480}}; }));
  EXPECT_TRUE(refused([](View& v) { v.cameras = {{0, -1, 320, 480}}; }));
  EXPECT_TRUE(refused([](View& v) { v.cameras = {{0, 0, 320, 0}}; }));
  EXPECT_TRUE(refused([](View& v) { v.cameras = {{2000000, 0, 320, 480}}; }));
  EXPECT_TRUE(refused([](View& v) { v.cameras = {{0, 2000000, 320, 480}}; }));
  EXPECT_TRUE(refused([](View& v) { v.cameras = {{0, 0, 2000000, 480}}; }));
  EXPECT_TRUE(refused([](View& v) { v.cameras = {{0, 0, 320, 2000000}}; }));
}

}  // namespace
}  // namespace tutti
