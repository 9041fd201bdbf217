// The focal length that photos name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "apps/run/recording.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

// A value of a photo's EXIF: a whole number (denominator 0), or a fraction.
struct ExifValue {
  std::uint16_t tag = 0;
  std::uint32_t numerator = 0, denominator = 0;
};

constexpr std::uint16_t kFocalLength = 0x920A, kFocalLengthIn35mmFilm = 0xA405, kPixelXDimension = 0xA002,
                        kFocalPlaneXResolution = 0xA20E, kFocalPlaneResolutionUnit = 0xA210;

// A grey JPEG with these in its EXIF.
void WritePhoto(const std::filesystem::path& file, cv::Size size, const std::vector<ExifValue>& values) {
  std::string tiff("II*\0\x08\0\0\0", 8);
  const auto put = [&tiff](std::uint32_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) tiff += static_cast<char>(value >> (8 * i) & 0xFF);
  };
  // The first directory has the place of the second, which has the values; fractions stand behind it.
  put(1, 2);
  put(0x8769, 2), put(4, 2), put(1, 4), put(26, 4);
  put(0, 4);
  put(static_cast<std::uint32_t>(values.size()), 2);
  auto behind = static_cast<std::uint32_t>(26 + 2 + 12 * values.size() + 4);
  for (const ExifValue& value : values) {
    put(value.tag, 2);
    if (value.denominator == 0) {
      put(3, 2), put(1, 4), put(value.numerator, 4);
    } else {
      put(5, 2), put(1, 4), put(behind, 4);
      behind += 8;
    }
  }
  put(0, 4);
  for (const ExifValue& value : values) {
    if (value.denominator != 0) put(value.numerator, 4), put(value.denominator, 4);
  }
  const std::string segment = std::string("Exif\0\0", 6) + tiff;
  const auto length = static_cast<unsigned>(segment.size() + 2);
  std::vector<unsigned char> jpeg;
  cv::imencode(".jpg", cv::Mat(size, CV_8UC1, cv::Scalar(90)), jpeg);
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(jpeg.data()), 2);
  out << '\xFF' << '\xE1' << static_cast<char>(length >> 8) << static_cast<char>(length & 0xFF) << segment;
  out.write(reinterpret_cast<const char*>(jpeg.data()) + 2, static_cast<std::streamsize>(jpeg.size() - 2));
}

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
  const auto lens = Lens({{kFocalLengthIn35mmFilm, 32}});
  ASSERT_TRUE(lens);
  EXPECT_NEAR(lens->focal_px, 32 * 800 / 43.2666, 0.01);
  EXPECT_EQ(lens->text, "32 mm (EXIF) = 591.7 px");
}

TEST_F(PhotoLensTest, OfTheSensorIsScaledByItsPixels) {
  // 12 mm, and 1000 pixels a centimetre of the 1280 that the photo had.
  const auto lens = Lens({{kFocalLength, 1200, 100},
                          {kPixelXDimension, 1280},
                          {kFocalPlaneXResolution, 10000, 10},
                          {kFocalPlaneResolutionUnit, 3}});
  ASSERT_TRUE(lens);
  EXPECT_NEAR(lens->focal_px, 600, 1e-6);
  EXPECT_EQ(lens->text, "12 mm (EXIF) = 600.0 px");
  const auto in_inches = Lens({{kFocalLength, 12, 1}, {kFocalPlaneXResolution, 1270, 1}});
  ASSERT_TRUE(in_inches);
  EXPECT_NEAR(in_inches->focal_px, 600, 1e-6);
}

TEST_F(PhotoLensTest, ThatCantBeIsNone) {
  EXPECT_FALSE(Lens({}));
  EXPECT_FALSE(Lens({{kFocalLengthIn35mmFilm, 0}}));
  EXPECT_FALSE(Lens({{kFocalLengthIn35mmFilm, 60000}}));
  EXPECT_FALSE(Lens({{kFocalLength, 4, 1}}));  // nothing says how large its sensor is
  EXPECT_FALSE(ReadPhotoLens(folder_ / "nowhere.jpg", 640, 480));
  EXPECT_FALSE(ReadPhotoLens(folder_, 640, 480));
  std::ofstream(folder_ / "text.jpg") << "\xFF\xD8\xFF\xE1 Exif";
  EXPECT_FALSE(ReadPhotoLens(folder_ / "text.jpg", 640, 480));
}

TEST_F(PhotoLensTest, IsTheStartOfAGuessAndSaid) {
  for (const char* name : {"0.jpg", "1.jpg", "2.jpg"})
    WritePhoto(folder_ / name, size_, {{kFocalLengthIn35mmFilm, 32}});
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
  EXPECT_FALSE(Lens({{kFocalLengthIn35mmFilm, 32}}));
  EXPECT_THAT(Recognise(folder_, {}).findings.at(2), HasSubstr("built without libexif"));
}

#endif

TEST_F(PhotoLensTest, ThatIsNotThereNeedsNoWord) {
  cv::imwrite((folder_ / "0.jpg").string(), cv::Mat(size_, CV_8UC1, cv::Scalar(90)));
  EXPECT_THAT(Recognise(folder_, {}).findings.at(2), ::testing::Not(HasSubstr("EXIF")));
}

}  // namespace
}  // namespace tutti
