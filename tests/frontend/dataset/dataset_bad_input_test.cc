// Bad data sets: each gives one clear message that names the file and what to do, or one skipped frame; never
// a crash.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "gmock/gmock.h"
#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {
using ::testing::AllOf, ::testing::HasSubstr;
using testing::Difference, testing::FreshFolder, testing::MakeKitti, testing::OpenError, testing::Picture,
    testing::Truncate, testing::With, testing::WriteImage, testing::WriteText;

const std::string kNone = "no error";

TEST(DatasetBadInputTest, MissingAndEmptyFoldersAreNamed) {
  const auto folder = FreshFolder();
  EXPECT_THAT(OpenError(folder / "nowhere", With(Sensor::kMono)),
              AllOf(HasSubstr("nowhere"), HasSubstr("does not exist")));
  EXPECT_THAT(OpenError(folder, With(Sensor::kMono)), HasSubstr("is empty"));
  WriteText(folder / "notes.txt", "x");
  EXPECT_THAT(OpenError(folder, With(Sensor::kMono)), HasSubstr("expected image_0/"));
  std::filesystem::create_directories(folder / "image_0");
  EXPECT_NE(OpenError(folder, With(Sensor::kMono)), kNone);
  EXPECT_THAT(OpenError(folder / "notes.txt", With(Sensor::kMono)), HasSubstr("video"));
  WriteText(folder / "zero.mp4", "");
  EXPECT_THAT(OpenError(folder / "zero.mp4", With(Sensor::kMono)), HasSubstr("empty"));
}

TEST(DatasetBadInputTest, TruncatedImagesOfEachFormatAreErrorsOfTheirFrame) {
  for (const char* extension : {".png", ".jpg", ".webp", ".bmp"}) {
    for (const double part : {0.0, 0.02, 0.5, 0.97}) {
      const auto folder = FreshFolder();
      MakeKitti(folder, 3, false, extension);
      const auto broken = folder / "image_0" / ("000001" + std::string(extension));
      Truncate(broken, part);
      const auto data = OpenDataset(folder, With(Sensor::kMono));
      EXPECT_EQ(data->Size(), 3U);
      const ReadResult result = data->Read(1);
      EXPECT_FALSE(result.frame) << extension << " " << part;
      EXPECT_THAT(result.error, HasSubstr(broken.string()));
      EXPECT_TRUE(data->Read(0).frame);
      EXPECT_TRUE(data->Read(2).frame);
    }
  }
}

TEST(DatasetBadInputTest, DamagedBytesInsideAPngAreAnErrorOfTheirFrame) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 3, false);
  const auto file = folder / "image_0" / "000001.png";
  std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
  bytes.seekp(static_cast<std::streamoff>(std::filesystem::file_size(file) / 2));
  bytes << "damaged damaged";
  bytes.close();
  EXPECT_THAT(OpenDataset(folder, With(Sensor::kMono))->Read(1).error, HasSubstr("000001.png"));
}

TEST(DatasetBadInputTest, TruncatedVideoGivesItsFramesAndThenErrors) {
  const auto file = FreshFolder() / "clip.avi";
  std::vector<cv::Mat> images;
  for (int i = 0; i < 30; ++i) images.push_back(Picture(64, 48, i));
  if (!testing::WriteMotionJpeg(file, images)) GTEST_SKIP() << "this OpenCV can't write a video";
  Truncate(file, 0.6);
  std::unique_ptr<Dataset> data;
  try {
    data = OpenDataset(file, With(Sensor::kMono));
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("clip.avi"));
    return;
  }
  for (std::size_t i = 0; i < data->Size(); ++i) {
    const ReadResult r = data->Read(i);
    EXPECT_TRUE(r.frame || r.error.find("clip.avi") != std::string::npos) << r.error;
  }
  EXPECT_FALSE(data->Read(29).frame);
}

TEST(DatasetBadInputTest, TheFirstImageMayBeBrokenButNotAll) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 3, false);
  Truncate(folder / "image_0" / "000000.png", 0.3);
  EXPECT_TRUE(OpenDataset(folder, With(Sensor::kMono))->Read(1).frame);
  for (const char* name : {"000001.png", "000002.png"}) WriteText(folder / "image_0" / name, "not an image");
  EXPECT_THAT(OpenError(folder, With(Sensor::kMono)),
              AllOf(HasSubstr("000000.png"), HasSubstr("none of the first 3")));
}

TEST(DatasetBadInputTest, AMissingImageIsAnErrorOfItsFrameAndAMissingRightOneIsNot) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 5, true);
  std::filesystem::remove(folder / "image_1" / "000001.png");
  std::filesystem::remove(folder / "image_0" / "000003.png");
  const auto data = OpenDataset(folder, With(Sensor::kStereo));
  ASSERT_EQ(data->Size(), 5U);
  EXPECT_THAT(data->Warnings().back(), AllOf(HasSubstr("image_1"), HasSubstr("1 of 5 left images")));
  const ReadResult alone = data->Read(1);
  ASSERT_TRUE(alone.frame) << alone.error;
  EXPECT_TRUE(alone.frame->right.empty());
  EXPECT_TRUE(alone.depth_error.empty());
  EXPECT_THAT(data->Read(3).error, HasSubstr("000003.png"));
  EXPECT_TRUE(data->Read(4).frame);
  EXPECT_THAT(data->Read(5).error, HasSubstr("no frame 5"));
}

TEST(DatasetBadInputTest, ADamagedRightImageIsNamedAndItsFrameComesWithout) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 4, true);
  Truncate(folder / "image_1" / "000001.png", 0.3);
  WriteImage(folder / "image_1" / "000002.png", Picture(32, 48, 1));
  const auto data = OpenDataset(folder, With(Sensor::kStereo));
  const ReadResult cut = data->Read(1), small = data->Read(2);
  EXPECT_THAT(cut.depth_error, AllOf(HasSubstr("image_1"), HasSubstr("000001.png"), HasSubstr("truncated")));
  EXPECT_THAT(small.depth_error, AllOf(HasSubstr("000002.png"), HasSubstr("32x48")));
  for (const ReadResult* read : {&cut, &small}) {
    ASSERT_TRUE(read->frame) << read->error;
    EXPECT_TRUE(read->frame->right.empty());
  }
  EXPECT_FALSE(data->Read(3).frame->right.empty());
  for (int i = 0; i < 4; ++i) {
    std::filesystem::rename(folder / "image_1" / ("00000" + std::to_string(i) + ".png"),
                            folder / "image_1" / ("00010" + std::to_string(i) + ".png"));
  }
  EXPECT_THAT(OpenError(folder, With(Sensor::kStereo)), HasSubstr("no image has the number"));
}

TEST(DatasetBadInputTest, ImagesOfChangingSizeAreErrorsOfTheirFrame) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 3, false);
  WriteImage(folder / "image_0" / "000001.png", Picture(32, 48, 1));
  EXPECT_THAT(OpenDataset(folder, With(Sensor::kMono))->Read(1).error,
              AllOf(HasSubstr("32x48"), HasSubstr("64x48")));
}

TEST(DatasetBadInputTest, MissingOrWrongCalibration) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 2, true);
  std::filesystem::remove(folder / "calib.txt");
  EXPECT_THAT(OpenError(folder, With(Sensor::kMono)), AllOf(HasSubstr("calib.txt"), HasSubstr("camera:")));
  EXPECT_EQ(OpenError(folder, With(Sensor::kMono, true)), kNone);
  EXPECT_THAT(OpenError(folder, With(Sensor::kStereo, true)), HasSubstr("baseline_m"));
  const auto error = [&](const std::string& calibration) {
    WriteText(folder / "calib.txt", calibration);
    return OpenError(folder, With(Sensor::kMono));
  };
  EXPECT_THAT(error("P0: 1 2 3\n"), HasSubstr("calib.txt:1: "));
  EXPECT_THAT(error("P0: 100 0 32 0 0 nan 24 0 0 0 1 0\n"),
              AllOf(HasSubstr("calib.txt:1: "), HasSubstr("nan")));
  EXPECT_THAT(error("P7: 100 0 32 0 0 100 24 0 0 0 1 0\n"), HasSubstr("P0"));
  DatasetOptions other = With(Sensor::kMono, true);
  other.camera->width = 640;
  EXPECT_THAT(OpenError(folder, other), AllOf(HasSubstr("640x48"), HasSubstr("64x48")));
}

TEST(DatasetBadInputTest, WrongNumberOfPosesAndNaN) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 3, false);
  const auto data = OpenDataset(folder, With(Sensor::kMono));
  const std::string pose = "1 0 0 0 0 1 0 0 0 0 1 0\n";
  const auto error = [&](const std::string& poses) {
    WriteText(folder / "poses.txt", poses);
    return testing::ErrorOf([&] { data->ReadGroundTruth(folder / "poses.txt", nullptr); });
  };
  EXPECT_EQ(error(pose + pose + pose), kNone);
  EXPECT_THAT(error(pose + pose), AllOf(HasSubstr("poses.txt"), HasSubstr("2 poses"), HasSubstr("3 frames")));
  EXPECT_THAT(error(pose + pose + pose + pose), HasSubstr("4 poses"));
  EXPECT_THAT(error(pose + "1 0 0 nan 0 1 0 0 0 0 1 0\n" + pose),
              AllOf(HasSubstr("poses.txt:2: "), HasSubstr("nan")));
  EXPECT_THAT(error(""), HasSubstr("no pose"));
}

TEST(DatasetBadInputTest, TimeStampsMustGrow) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 4, false);
  WriteText(folder / "times.txt", "0\n0.1\n0.1\n0.2\n");
  const auto data = OpenDataset(folder, With(Sensor::kMono));
  ASSERT_EQ(data->Size(), 3U);
  EXPECT_THAT(data->Warnings()[0], AllOf(HasSubstr("times.txt:3: "), HasSubstr("skipped")));
  EXPECT_EQ(data->Read(2).frame->index, 2);  // what is skipped has no number
  EXPECT_EQ(Difference(data->Read(2).frame->image, Picture(64, 48, 3)), 0);
  EXPECT_EQ(data->ReadGroundTruth(folder / "poses.txt", nullptr).size(), 3U);
  const auto error = [&](const std::string& times) {
    WriteText(folder / "times.txt", times);
    return OpenError(folder, With(Sensor::kMono));
  };
  EXPECT_THAT(error("0\n0.2\n0.1\n0.3\n"), AllOf(HasSubstr("times.txt:3: "), HasSubstr("sort")));
  EXPECT_THAT(error("0\n0.1\nnan\n0.3\n"), HasSubstr("times.txt:3: "));
  EXPECT_THAT(error("0\n0.1\n"), AllOf(HasSubstr("2 time stamps"), HasSubstr("number 3")));
}

TEST(DatasetBadInputTest, TumListsAreChecked) {
  const auto folder = FreshFolder();
  WriteImage(folder / "rgb/a.png", Picture(64, 48, 1));
  WriteImage(folder / "rgb/b.png", Picture(64, 48, 2));
  WriteImage(folder / "depth/a.png", cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(9)));
  WriteImage(folder / "depth/b.png", cv::Mat(24, 32, CV_16UC1, cv::Scalar::all(9)));
  WriteText(folder / "rgb.txt", "1.0 rgb/a.png\n2.0 rgb/b.png\n");
  EXPECT_THAT(OpenError(folder, With(Sensor::kRgbd, true)), HasSubstr("depth.txt"));
  WriteText(folder / "depth.txt", "1.5 depth/a.png\n2.5 depth/b.png\n");
  EXPECT_THAT(OpenError(folder, With(Sensor::kRgbd, true)), HasSubstr("max_association_s"));
  WriteText(folder / "depth.txt", "1.0 depth/a.png\n2.0 depth/b.png\n");
  EXPECT_THAT(OpenError(folder, With(Sensor::kRgbd)), HasSubstr("no calibration"));
  EXPECT_THAT(OpenError(folder, With(Sensor::kStereo, true)), HasSubstr("no stereo"));
  const auto data = OpenDataset(folder, With(Sensor::kRgbd, true));
  EXPECT_THAT(data->Read(0).depth_error, AllOf(HasSubstr("depth/a.png"), HasSubstr("no depth image")));
  EXPECT_THAT(data->Read(1).depth_error, AllOf(HasSubstr("32x24"), HasSubstr("registered")));
  ASSERT_TRUE(data->Read(1).frame) << data->Read(1).error;
  EXPECT_TRUE(data->Read(1).frame->depth_m.empty());
  WriteText(folder / "depth.txt", "# nothing yet\n");
  EXPECT_THAT(OpenError(folder, With(Sensor::kRgbd, true)),
              AllOf(HasSubstr("depth.txt"), HasSubstr("lists no images")));
  WriteText(folder / "depth.txt", "1.0 depth/a.png\n");
  const auto error = [&](const std::string& list) {
    WriteText(folder / "rgb.txt", list);
    return OpenError(folder, With(Sensor::kMono, true));
  };
  EXPECT_THAT(error("2.0 rgb/a.png\n1.0 rgb/b.png\n"), HasSubstr("rgb.txt:2: "));
  EXPECT_THAT(error("1.0\n"), HasSubstr("rgb.txt:1: "));
  EXPECT_THAT(error(""), HasSubstr("lists no images"));
  EXPECT_EQ(error("1.0 rgb/a.png\n1.0 rgb/b.png\n"), kNone);
  EXPECT_THAT(OpenDataset(folder, With(Sensor::kMono, true))->Warnings()[0], HasSubstr("rgb.txt:2: "));
}

TEST(DatasetBadInputTest, EurocSensorYamlIsChecked) {
  const auto folder = FreshFolder();
  const auto camera = folder / "mav0/cam0";
  WriteImage(camera / "data/1000000000.png", Picture(64, 48, 1));
  WriteText(camera / "data.csv", "#timestamp [ns],filename\n1000000000,1000000000.png\n");
  EXPECT_THAT(OpenError(folder, With(Sensor::kMono)), HasSubstr("sensor.yaml"));
  const std::string good =
      "%YAML:1.0\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, 0.5,\n         0.0, 1.0, 0.0, 0.0,\n  "
      "       0.0, 0.0, 1.0, 0.0,\n"
      "         0.0, 0.0, 0.0, 1.0]\nrate_hz: 20\nresolution: [64, 48]\nintrinsics: [60, 60, 32, 24] #fu\n"
      "distortion_model: equidistant\ndistortion_coefficients: [0.01, 0, 0, 0]\n";
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    return text.replace(text.find(from), from.size(), to);
  };
  WriteText(camera / "sensor.yaml", good);
  const auto data = OpenDataset(folder, With(Sensor::kMono));
  EXPECT_DOUBLE_EQ(data->Rig().T_body_camera.translation.x(), 0.5);
  EXPECT_DOUBLE_EQ(data->Stamp(0), 1.0);
  EXPECT_TRUE(data->Read(0).frame);
  EXPECT_THAT(OpenError(folder, With(Sensor::kStereo)), AllOf(HasSubstr("cam1"), HasSubstr("sensor.yaml")));
  WriteText(folder / "mav0/cam1/sensor.yaml", replaced("0.0, 0.5,", "0.0, 0.7,"));
  WriteText(folder / "mav0/cam1/data.csv", "9000000000,9000000000.png\n");
  EXPECT_THAT(OpenError(folder, With(Sensor::kStereo)), HasSubstr("no image has the time stamp"));
  WriteText(camera / "data.csv", "1000000000,1000000000.png\n2000000000,1000000000.png\n");
  WriteImage(folder / "mav0/cam1/data/1000000000.png", Picture(64, 48, 2));
  WriteText(folder / "mav0/cam1/data.csv", "1000000000,1000000000.png\n");
  const auto pair = OpenDataset(folder, With(Sensor::kStereo));
  ASSERT_EQ(pair->Size(), 2U);
  EXPECT_THAT(pair->Warnings().back(), HasSubstr("1 of 2 left images have no right image"));
  EXPECT_FALSE(pair->Read(0).frame->right.empty());
  EXPECT_TRUE(pair->Read(1).frame->right.empty());
  for (const auto& [from, to, error] : {std::array{"[60, 60, 32, 24]", "[60, 60]", "sensor.yaml:11: "},
                                        {"equidistant", "omni", "omni"},
                                        {"[1.0, 0.0", "[0.0, 0.0", "T_BS"},
                                        {"[1.0, 0.0, 0.0, 0.5,", "[1e200, 1e200, 0.0, 0.5,", "T_BS"},
                                        {"[64, 48]", "[1e300, 48]", "camera.width"}}) {
    WriteText(camera / "sensor.yaml", replaced(from, to));
    EXPECT_THAT(OpenError(folder, With(Sensor::kMono)), HasSubstr(error));
  }
  WriteText(camera / "sensor.yaml", good);
  WriteText(camera / "data.csv", "12x,a.png\n");
  EXPECT_THAT(OpenError(folder, With(Sensor::kMono)), HasSubstr("data.csv:1: "));
}

TEST(DatasetBadInputTest, OptionsAreChecked) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 2, false);
  DatasetOptions options = With(Sensor::kMono);
  options.stride = 0;
  EXPECT_THAT(OpenError(folder, options), HasSubstr("stride"));
  EXPECT_THAT(OpenError(folder, With(Sensor::kRgbd)), HasSubstr("no depth"));
  options = With(Sensor::kMono);
  options.start = 2;
  EXPECT_THAT(OpenError(folder, options), HasSubstr("has 2 frames, 0 to 1; it can't start with frame 2"));
  options.end = 2;
  EXPECT_THAT(OpenError(folder, options), HasSubstr("end must be greater than start (2); it is 2"));
  options = With(Sensor::kMono);
  options.type = DatasetType::kVideo;
  EXPECT_THAT(OpenError(folder, options), HasSubstr("is a folder"));
}

TEST(DatasetBadInputTest, ListsMayBeginWithAMarkAndNameFilesWithBlanks) {
  const auto folder = FreshFolder();
  WriteImage(folder / "rgb" / "a b, c.png", Picture(64, 48, 1));
  WriteImage(folder / "rgb" / "d.png", Picture(64, 48, 2));
  WriteText(folder / "rgb.txt",
            "\xEF\xBB\xBF"
            "0.1 rgb/a b, c.png\r\n0.2 rgb/d.png\r\n");
  DatasetOptions options = With(Sensor::kMono);
  options.camera = tutti::testing::SmallCamera();
  const auto data = OpenDataset(folder, options);
  ASSERT_EQ(data->Size(), 2U);
  EXPECT_TRUE(data->Read(0).frame) << data->Read(0).error;
  EXPECT_TRUE(data->Read(1).frame) << data->Read(1).error;
  WriteText(folder / "rgb.txt", "0,1 rgb/d.png\n");
  EXPECT_THAT(OpenError(folder, options), HasSubstr("rgb.txt:1: '0,1' has a decimal comma"));
}

TEST(DatasetBadInputTest, WhatNoImageIsCostsNeitherMemoryNorTime) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 6, false);
  const auto image = [&](int i) { return folder / "image_0" / ("00000" + std::to_string(i) + ".png"); };
  for (int i = 1; i < 6; ++i) std::filesystem::remove(image(i));
  WriteText(image(1), "P5 60000 60000 255\n" + std::string(100, 'x'));
  WriteText(image(2), "BM" + std::string(16, '\0') + "\x60\xEA" + std::string(2, '\0') + "\xA0\x15\xFF\xFF" +
                          std::string(60, '\0'));  // from the top row: its height is -60000
  WriteText(image(3), "");
  std::filesystem::resize_file(image(3), 300000000000ULL);
  ASSERT_EQ(mkfifo(image(4).c_str(), 0600), 0);
  std::filesystem::create_symlink(image(5), image(5));
  const auto data = OpenDataset(folder, With(Sensor::kMono));
  EXPECT_TRUE(data->Read(0).frame);
  for (const std::size_t i : {1U, 2U}) EXPECT_THAT(data->Read(i).error, HasSubstr("60000 x 60000 pixels"));
  EXPECT_THAT(data->Read(3).error, HasSubstr("too large for an image (300000 MB"));
  EXPECT_THAT(data->Read(4).error, HasSubstr("can't be read"));
  EXPECT_THAT(data->Read(5).error, HasSubstr("can't be read"));
}

}  // namespace
}  // namespace tutti
