#include "frontend/store/grey_bytes.h"

#include <gtest/gtest.h>

#include "core/section_file.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"

namespace tutti::internal {
namespace {

void ExpectBack(const cv::Mat& image) {
  cv::Mat back(image.size(), CV_8UC1, cv::Scalar(7));
  ASSERT_TRUE(GetGrey(PutGrey(image), &back)) << image.size();
  EXPECT_EQ(cv::norm(image, back, cv::NORM_L1), 0) << image.size();
}

TEST(GreyBytes, AnyImageComesBackAsItWas) {
  cv::RNG random(3);
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 9), cv::Size(9, 1), cv::Size(17, 40)}) {
    cv::Mat image(size, CV_8UC1);
    random.fill(image, cv::RNG::UNIFORM, 0, 256);
    ExpectBack(image);
    ExpectBack(cv::Mat(size, CV_8UC1, cv::Scalar(255)));
  }
  const cv::Mat town = testing::RenderedWorld(testing::SmallStereoTown(400, 200)).Render(0).image;
  ExpectBack(town);
  ExpectBack(town(cv::Rect(10, 20, 50, 30)));  // rows that do not follow each other
  SectionPacker packer;
  EXPECT_LT(packer.Pack(PutGrey(town), "", 16).size(), 0.8 * static_cast<double>(town.total()));
  cv::Mat nothing(0, 17, CV_8UC1);
  EXPECT_TRUE(GetGrey(PutGrey(nothing), &nothing));
}

TEST(GreyBytes, WhatIsOfAnotherSizeOrDamagedIsRefused) {
  const cv::Mat image(20, 30, CV_8UC1, cv::Scalar(9));
  const std::string packed = PutGrey(image);
  cv::Mat smaller(19, 30, CV_8UC1), larger(21, 30, CV_8UC1), same(20, 30, CV_8UC1);
  EXPECT_FALSE(GetGrey(packed, &smaller));
  EXPECT_FALSE(GetGrey(packed, &larger));
  EXPECT_FALSE(GetGrey(packed.substr(0, packed.size() / 2), &same));
  EXPECT_FALSE(GetGrey("no such thing", &same));
  EXPECT_FALSE(GetGrey("", &same));
}

TEST(GreyBytes, FewBytesAreNoLargeImage) {
  EXPECT_TRUE(IsGrey(PutGrey(cv::Mat(200, 100, CV_8UC1, cv::Scalar(0))), 200, 100));
  EXPECT_FALSE(IsGrey(std::string(100, 'x'), 2000, 2000));
  EXPECT_FALSE(IsGrey(std::string(100, 'x'), -1, 5));
  EXPECT_FALSE(IsGrey(std::string(100, 'x'), 1 << 20, 1));
}

}  // namespace
}  // namespace tutti::internal
