// Parts of images that are not used.
#include "frontend/dataset/image_mask.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frontend/features/rectifier.h"
#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf, ::testing::HasSubstr;
using testing::Difference, testing::FreshFolder, testing::OpenError, testing::Picture, testing::With,
    testing::WriteImage;

// The lower 10 of 48 rows are not used.
cv::Mat LowerRows(cv::Size size = {64, 48}) {
  cv::Mat mask(size, CV_8UC1, cv::Scalar(255));
  mask.rowRange(size.height - 10, size.height).setTo(0);
  return mask;
}

fs::path ThreeImages() {
  fs::path folder = FreshFolder() / "images";
  for (int i = 0; i < 3; ++i) WriteImage(folder / ("view" + std::to_string(i) + ".png"), Picture(64, 48, i));
  return folder;
}

DatasetOptions Masked(const fs::path& mask) {
  DatasetOptions options = With(Sensor::kMono, true);
  options.mask = mask.string();
  return options;
}

TEST(ImageMask, OfAllImagesComesWithEachFrame) {
  const fs::path folder = ThreeImages(), mask = folder.parent_path() / "mask.png";
  WriteImage(mask, LowerRows());
  const auto dataset = OpenDataset(folder, Masked(mask));
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(Difference(dataset->Read(i).frame->mask, LowerRows()), 0);
  EXPECT_TRUE(dataset->Warnings().empty());
  EXPECT_TRUE(OpenDataset(folder, With(Sensor::kMono, true))->Read(0).frame->mask.empty());
}

TEST(ImageMask, OfEachImageHasItsNameAndThoseWithoutAreCounted) {
  const fs::path folder = ThreeImages(), masks = folder.parent_path() / "masks";
  WriteImage(masks / "view1.bmp", LowerRows());
  const auto dataset = OpenDataset(folder, Masked(masks));
  EXPECT_TRUE(dataset->Read(0).frame->mask.empty());
  EXPECT_EQ(Difference(dataset->Read(1).frame->mask, LowerRows()), 0);
  ASSERT_EQ(dataset->Warnings().size(), 1u);
  EXPECT_THAT(dataset->Warnings()[0], HasSubstr("2 of 3 images have no mask"));
}

TEST(ImageMask, IsRectifiedWithTheImage) {
  const fs::path folder = ThreeImages(), mask = folder.parent_path() / "mask.png";
  WriteImage(mask, LowerRows());
  DatasetOptions options = Masked(mask);
  options.camera->distortion = Distortion::kRadTan;
  options.camera->coefficients = {-0.3, 0.1, 0, 0, 0};
  const Rectifier rectifier(*options.camera);
  EXPECT_EQ(Difference(OpenDataset(folder, options)->Read(0).frame->mask,
                       rectifier.Apply(LowerRows(), Sampling::kNearest)),
            0);
}

TEST(ImageMask, OfAVideoIsOneForAllFrames) {
  const fs::path folder = FreshFolder(), file = folder / "video.avi";
  const std::vector<cv::Mat> images(3, cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(40)));
  if (!testing::WriteMotionJpeg(file, images)) GTEST_SKIP() << "this OpenCV can't write a video";
  WriteImage(folder / "mask.png", LowerRows());
  for (const std::string& name : {file.string(), "camera:" + file.string()}) {
    const auto dataset = OpenDataset(name, Masked(folder / "mask.png"));
    ASSERT_TRUE(dataset->WaitFor(0, [] { return false; }));
    EXPECT_EQ(Difference(dataset->Read(0).frame->mask, LowerRows()), 0) << name;
  }
  WriteImage(folder / "masks" / "0.png", LowerRows());
  EXPECT_THAT(OpenError(file, Masked(folder / "masks")),
              AllOf(HasSubstr("masks"), HasSubstr("is a folder of masks")));
}

TEST(ImageMask, ThatCantBeUsedIsNamedBeforeTheRun) {
  const fs::path folder = ThreeImages(), mask = folder.parent_path() / "mask.png";
  EXPECT_THAT(OpenError(folder, Masked(mask)), HasSubstr("mask.png: does not exist"));
  WriteImage(mask, LowerRows({32, 48}));
  EXPECT_THAT(OpenError(folder, Masked(mask)),
              AllOf(HasSubstr("mask.png: the mask has 32x48 pixels, but the images have 64x48")));
  WriteImage(mask, cv::Mat(48, 64, CV_8UC1, cv::Scalar(0)));
  EXPECT_THAT(OpenError(folder, Masked(mask)), HasSubstr("mask.png: this mask is 0 all over"));
  WriteImage(mask, cv::Mat(48, 64, CV_16UC1, cv::Scalar(1000)));
  EXPECT_THAT(OpenError(folder, Masked(mask)), HasSubstr("8 bits"));
  testing::WriteText(mask, "no image");
  EXPECT_THAT(OpenError(folder, Masked(mask)),
              AllOf(HasSubstr("mask.png: is damaged"), HasSubstr("the mask")));
  const fs::path masks = folder.parent_path() / "masks";
  fs::create_directories(masks);
  EXPECT_THAT(OpenError(folder, Masked(masks)), HasSubstr("masks: holds no masks"));
  WriteImage(masks / "other.png", LowerRows());
  EXPECT_THAT(OpenError(folder, Masked(masks)), HasSubstr("holds no mask for any of 3 images"));
  WriteImage(masks / "view2.png", LowerRows({64, 40}));
  EXPECT_THAT(OpenError(folder, Masked(masks)), HasSubstr("view2.png: the mask has 64x40"));
}

TEST(ImageMask, OfOneImageThatIsDamagedCostsThatFrameAlone) {
  const fs::path folder = ThreeImages(), masks = folder.parent_path() / "masks";
  for (const char* name : {"view0.png", "view1.png", "view2.png"}) WriteImage(masks / name, LowerRows());
  testing::Truncate(masks / "view1.png", 0.5);
  const auto dataset = OpenDataset(folder, Masked(masks));
  EXPECT_TRUE(dataset->Read(0).frame);
  EXPECT_THAT(dataset->Read(1).error, AllOf(HasSubstr("view1.png"), HasSubstr("truncated")));
  EXPECT_TRUE(dataset->Read(2).frame);
}

}  // namespace
}  // namespace tutti
