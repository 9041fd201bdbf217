#include "frontend/features/features.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/state_archive.h"
#include "frontend/store/features_state.h"

namespace tutti {
namespace {

cv::Mat Slope() {
  cv::Mat image(200, 300, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x)
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>((3 * x + 5 * y) % 251);
  }
  return image;
}

std::string Saved(const std::shared_ptr<const Pyramid>& pyramid) {
  internal::SharedObjectsOut shared;
  internal::StateWriter out(&shared);
  out(pyramid);
  return out.Take();
}

std::shared_ptr<const Pyramid> Loaded(const std::string& bytes) {
  internal::SharedObjectsIn shared;
  internal::StateReader in(bytes, "f", &shared);
  std::shared_ptr<const Pyramid> pyramid;
  in(pyramid);
  in.ExpectEnd();
  return pyramid;
}

void ExpectSameLevels(const Pyramid& a, const Pyramid& b) {
  ASSERT_EQ(a.Levels().size(), b.Levels().size());
  for (std::size_t l = 0; l < a.Levels().size(); ++l)
    EXPECT_EQ(cv::norm(a.Levels()[l], b.Levels()[l], cv::NORM_L1), 0) << l;
}

TEST(Pyramid, HasTheLevelsThatItWasMadeOf) {
  const cv::Mat image = Slope();
  const Pyramid pyramid({image, NextLevel(image, {150, 100})});
  ASSERT_EQ(pyramid.Levels().size(), 2U);
  EXPECT_EQ(pyramid.Levels()[0].data, image.data) << "no copy";
  EXPECT_EQ(pyramid.Levels()[1].size(), cv::Size(150, 100));
  EXPECT_TRUE(Pyramid().Levels().empty());
}

TEST(Pyramid, OfASavedMapHasItsLevelsWhenAskedForThem) {
  const auto made = std::make_shared<const Pyramid>(BuildPyramid(Slope(), OdometryOptions()));
  ASSERT_GT(made->Levels().size(), 2U);
  const std::shared_ptr<const Pyramid> loaded = Loaded(Saved(made));
  ExpectSameLevels(*loaded, *made);
  EXPECT_EQ(&loaded->Levels()[0], &loaded->Levels()[0]) << "made once";
  EXPECT_EQ(Saved(Loaded(Saved(made))), Saved(made)) << "saved again before anybody asked";
}

TEST(Pyramid, ManyThreadsMayAskAtOnce) {
  const auto made = std::make_shared<const Pyramid>(BuildPyramid(Slope(), OdometryOptions()));
  const std::shared_ptr<const Pyramid> loaded = Loaded(Saved(made));
  std::vector<const cv::Mat*> first(8);
  std::vector<std::thread> threads;
  threads.reserve(first.size());
  for (const cv::Mat*& level : first) threads.emplace_back([&] { level = &loaded->Levels().front(); });
  for (std::thread& thread : threads) thread.join();
  for (const cv::Mat* level : first) EXPECT_EQ(level, first[0]);
  ExpectSameLevels(*loaded, *made);
}

}  // namespace
}  // namespace tutti
