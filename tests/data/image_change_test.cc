#include "data/synthetic/image_change.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "data/synthetic/synthetic_world.h"
#include "gmock/gmock.h"
#include "tests/support/error_of.h"

namespace tutti {
namespace {
using testing::ErrorOf;
using ::testing::HasSubstr;

cv::Mat Street() {
  SyntheticOptions o;
  o.width = 320;
  o.height = 160;
  o.supersample = 1;
  o.blocks_x = 1;
  return SyntheticWorld(o).Render(5).image;
}

// Another tone in each channel.
cv::Mat ColouredStreet() {
  const cv::Mat grey = Street();
  cv::Mat out;
  cv::merge(std::vector<cv::Mat>{0.6 * grey, 0.8 * grey, grey}, out);
  return out;
}

bool Same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

std::vector<std::string> AllWithBothStrengths() {
  std::vector<std::string> all;
  for (const std::string& name : ImageChange::Names()) {
    for (const char* strength : {":1", ":2"}) all.push_back(name + strength);
  }
  return all;
}

TEST(ImageChangeTest, TheSameSeedAndIndexGiveTheSameBytes) {
  for (const cv::Mat& image : {Street(), ColouredStreet()}) {
    const cv::Mat before = image.clone();
    for (const std::string& text : AllWithBothStrengths()) {
      const cv::Mat one = ImageChange::Parse(text).Apply(image, 7, 3);
      EXPECT_TRUE(Same(one, ImageChange::Parse(text).Apply(image, 7, 3))) << text;
      EXPECT_EQ(one.type(), image.type()) << text;
      EXPECT_FALSE(Same(one, image)) << text;
      EXPECT_TRUE(Same(image, before)) << text << " must not write into its input";
    }
  }
}

TEST(ImageChangeTest, AnotherSeedGivesOtherBytesExceptForJpegAndHalf) {
  const cv::Mat image = Street();
  for (const std::string& text : AllWithBothStrengths()) {
    const ImageChange change = ImageChange::Parse(text);
    const bool plain = change.Name() == "jpeg" || change.Name() == "half";
    EXPECT_EQ(Same(change.Apply(image, 7, 3), change.Apply(image, 8, 3)), plain) << text;
  }
}

TEST(ImageChangeTest, NoiseBlurRainAndOccludersDifferFromImageToImage) {
  const cv::Mat image = Street();
  for (const char* text : {"dark", "overexposed:2", "blur", "occluded", "rain"}) {
    const ImageChange change = ImageChange::Parse(text);
    EXPECT_FALSE(Same(change.Apply(image, 1, 3), change.Apply(image, 1, 4))) << text;
  }
  const ImageChange roll = ImageChange::Parse("roll");
  EXPECT_TRUE(Same(roll.Apply(image, 1, 3), roll.Apply(image, 1, 4)));
}

TEST(ImageChangeTest, StrengthTwoIsFartherFromTheOriginal) {
  for (const cv::Mat& image : {Street(), ColouredStreet()}) {
    for (const std::string& name : ImageChange::Names()) {
      if (name == "half") continue;  // another size
      for (const int index : {0, 7, 50}) {
        const double mild = cv::PSNR(image, ImageChange::Parse(name + ":1").Apply(image, 1, index));
        const double strong = cv::PSNR(image, ImageChange::Parse(name + ":2").Apply(image, 1, index));
        EXPECT_LT(strong, mild) << name << " " << index;
        EXPECT_LT(mild, 40) << name;
      }
    }
  }
}

TEST(ImageChangeTest, HalfIsReallySmaller) {
  EXPECT_EQ(ImageChange::Parse("half").Apply(Street(), 1, 0).size(), cv::Size(160, 80));
  EXPECT_EQ(ImageChange::Parse("half:2").Apply(Street(), 1, 0).size(), cv::Size(106, 53));
}

TEST(ImageChangeTest, OccludersCoverAQuarterOrTwoFifthsAndMoveOn) {
  // What two unlike plain images have in common after the change is the occluders (grey: no paint).
  const cv::Mat black(200, 400, CV_8UC1, cv::Scalar(0)), white(200, 400, CV_8UC1, cv::Scalar(255));
  for (const auto& [text, part] : {std::pair{"occluded:1", 0.25}, {"occluded:2", 0.4}}) {
    const ImageChange change = ImageChange::Parse(text);
    for (int index = 0; index < 40; index += 3) {
      const cv::Mat same = change.Apply(black, 1, index) == change.Apply(white, 1, index);
      EXPECT_NEAR(cv::countNonZero(same) / 80000.0, part, 0.03) << text << " " << index;
    }
  }
}

TEST(ImageChangeTest, ARolledImageHasNoEmptyCorners) {
  for (const cv::Size size : {cv::Size(320, 240), cv::Size(600, 180), cv::Size(100, 300)}) {
    const cv::Mat bright(size, CV_8UC1, cv::Scalar(200));
    for (const char* text : {"roll:1", "roll:2"}) {
      EXPECT_TRUE(Same(ImageChange::Parse(text).Apply(bright, 1, 0), bright)) << text << " " << size;
    }
  }
}

TEST(ImageChangeTest, TinyImagesAreChangedToo) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(3, 3), cv::Size(1, 40), cv::Size(40, 1)}) {
    for (const int type : {CV_8UC1, CV_8UC3}) {
      const cv::Mat image(size, type, cv::Scalar::all(90));
      for (const std::string& text : AllWithBothStrengths()) {
        const cv::Mat out = ImageChange::Parse(text).Apply(image, 1, 2);
        EXPECT_FALSE(out.empty()) << text << " " << size;
        EXPECT_EQ(out.type(), type) << text << " " << size;
      }
    }
  }
}

TEST(ImageChangeTest, UnknownNamesStrengthsAndImagesAreRefused) {
  EXPECT_THAT(ErrorOf([] { ImageChange::Parse("blurr:2"); }), HasSubstr("did you mean 'blur'?"));
  EXPECT_THAT(ErrorOf([] { ImageChange::Parse(""); }), HasSubstr("no such change"));
  for (const char* text : {"blur:3", "blur:", "blur:0", "blur:2:2", "blur:two"}) {
    EXPECT_THAT(ErrorOf([&] { ImageChange::Parse(text); }), HasSubstr("1 (mild) or 2 (strong)")) << text;
  }
  const ImageChange change = ImageChange::Parse("dark");
  EXPECT_EQ(change.Strength(), 1);
  EXPECT_THAT(ErrorOf([&] { change.Apply({}, 1, 0); }), HasSubstr("empty"));
  EXPECT_THAT(ErrorOf([&] { change.Apply(cv::Mat(4, 4, CV_16UC1, cv::Scalar(5)), 1, 0); }),
              HasSubstr("8 bits"));
}

}  // namespace
}  // namespace tutti
