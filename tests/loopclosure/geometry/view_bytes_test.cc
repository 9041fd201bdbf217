// Views as bytes and back.
#include "loopclosure/geometry/view_bytes.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "tests/support/plain_camera.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

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
  ByteWriter out;
  SaveView(view, out);
  ByteReader in(out.bytes(), "test");
  View loaded = LoadView(in);
  EXPECT_TRUE(in.AtEnd());
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

TEST(ViewBytes, EverythingComesBack) {
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

TEST(ViewBytes, OfAnImageWithoutCameraOrFeaturesComesBack) {
  View view;
  view.id = 0;
  view.size = {1, 1};
  const View again = Again(view);
  EXPECT_EQ(again.size, cv::Size(1, 1));
  EXPECT_TRUE(again.metric);
  EXPECT_FALSE(again.camera.has_value());
  EXPECT_TRUE(again.members.empty() && again.caller.pixels.empty() && again.cameras.empty());
}

TEST(ViewBytes, CutOffAnywhereItIsRefused) {
  View view = WholeView();
  view.cameras = {{0, 0, 320, 480}, {320, 0, 320, 480}};
  view.caller.numbers = {0, 1, 2, 3, 4, 5, 6, 7, 8};
  EXPECT_EQ(Again(view).cameras, view.cameras);
  EXPECT_EQ(Again(view).caller.numbers, view.caller.numbers);
  ByteWriter out;
  SaveView(view, out);
  const std::string good(out.bytes());
  for (std::size_t length = 0; length < good.size(); length += 3) {
    const std::string cut = good.substr(0, length);
    ByteReader in(cut, "test");
    EXPECT_THROW(LoadView(in), InputError) << length;
  }
}

// What no image has, each beside what one may have.
TEST(ViewBytes, ImpossibleOnesAreRefused) {
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
}  // namespace tutti::internal
