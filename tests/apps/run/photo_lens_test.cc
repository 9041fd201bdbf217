// The focal length that photos name.
#include "apps/run/recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/run/photo.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::ExifValue;
using ::testing::HasSubstr;
using testing::WritePhoto;

class PhotoLensTest : public ::testing::Test {
 protected:
  std::optional<PhotoLens> Lens(const std::vector<ExifValue>& values) const {
    WritePhoto(folder_ / "0.jpg", size_, values);
    return ReadPhotoLens(folder_ / "0.jpg", size_.width, size_.height);
  }
  const fs::path folder_ = testing::FreshFolder();
  const cv::Size size_{640, 480};
};

#ifdef TUTTI_WITH_EXIF

TEST_F(PhotoLensTest, OfAFilmsIsScaledByTheDiagonal) {
  const auto lens = Lens({{testing::kFocalLengthIn35mmFilm, 32}});
  ASSERT_TRUE(lens);
  EXPECT_NEAR(lens->focal_px, 32 * 800 / 43.2666, 0.01);
  EXPECT_EQ(lens->text, "32 mm (EXIF) = 591.7 px");
}

TEST_F(PhotoLensTest, OfTheSensorIsScaledByItsPixels) {
  // 12 mm, and 1000 pixels a centimetre of the 1280 that the photo had.
  const auto lens = Lens({{testing::kFocalLength, 1200, 100},
                          {testing::kPixelXDimension, 1280},
                          {testing::kFocalPlaneXResolution, 10000, 10},
                          {testing::kFocalPlaneResolutionUnit, 3}});
  ASSERT_TRUE(lens);
  EXPECT_NEAR(lens->focal_px, 600, 1e-6);
  EXPECT_EQ(lens->text, "12 mm (EXIF) = 600.0 px");
  const auto in_inches = Lens({{testing::kFocalLength, 12, 1}, {testing::kFocalPlaneXResolution, 1270, 1}});
  ASSERT_TRUE(in_inches);
  EXPECT_NEAR(in_inches->focal_px, 600, 1e-6);
}

TEST_F(PhotoLensTest, ThatCantBeIsNone) {
  EXPECT_FALSE(Lens({}));
  EXPECT_FALSE(Lens({{testing::kFocalLengthIn35mmFilm, 0}}));
  EXPECT_FALSE(Lens({{testing::kFocalLengthIn35mmFilm, 60000}}));
  EXPECT_FALSE(Lens({{testing::kFocalLength, 4, 1}}));  // nothing says how large its sensor is
  EXPECT_FALSE(ReadPhotoLens(folder_ / "nowhere.jpg", 640, 480));
  EXPECT_FALSE(ReadPhotoLens(folder_, 640, 480));
  std::ofstream(folder_ / "text.jpg") << "\xFF\xD8\xFF\xE1 Exif";
  EXPECT_FALSE(ReadPhotoLens(folder_ / "text.jpg", 640, 480));
}

TEST_F(PhotoLensTest, IsTheStartOfAGuessAndSaid) {
  for (const char* name : {"0.jpg", "1.jpg", "2.jpg"})
    WritePhoto(folder_ / name, size_, {{testing::kFocalLengthIn35mmFilm, 32}});
  const Recording photos = Recognise(folder_, {});
  EXPECT_TRUE(photos.guessed_lens);
  EXPECT_NEAR(photos.config.dataset.camera->fx, 591.7, 0.05);
  EXPECT_NEAR(photos.config.dataset.camera->cx, 319.5, 1e-9);
  EXPECT_THAT(photos.findings.at(2), HasSubstr("(32 mm (EXIF) = 591.7 px)"));
  CameraRequest camera;
  camera.view_deg = 90;
  EXPECT_NEAR(Recognise(folder_, camera).config.dataset.camera->fx, 320, 1e-9);
}

#else

TEST_F(PhotoLensTest, IsNotReadWithoutItsLibraryWhichIsSaid) {
  EXPECT_FALSE(Lens({{testing::kFocalLengthIn35mmFilm, 32}}));
  EXPECT_THAT(Recognise(folder_, {}).findings.at(2), HasSubstr("built without libexif"));
}

#endif

TEST_F(PhotoLensTest, ThatIsNotThereNeedsNoWord) {
  cv::imwrite((folder_ / "0.jpg").string(), cv::Mat(size_, CV_8UC1, cv::Scalar(90)));
  EXPECT_THAT(Recognise(folder_, {}).findings.at(2), ::testing::Not(HasSubstr("EXIF")));
}

}  // namespace
}  // namespace tutti
