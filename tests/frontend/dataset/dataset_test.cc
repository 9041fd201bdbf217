// The readers on good data, made up and real.
#include "tutti/frontend/dataset.h"

#include <algorithm>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "gmock/gmock.h"
#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {
using testing::Difference, testing::FrameOf, testing::FreshFolder, testing::MakeKitti, testing::OpenError,
    testing::Picture, testing::With, testing::WriteImage, testing::WriteText;
using ::testing::HasSubstr;

TEST(DatasetTest, KittiStereoHasCalibrationBaselineStampsAndPoses) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 4, true);
  const auto data = OpenDataset(folder, With(Sensor::kStereo));
  ASSERT_EQ(data->Size(), 4U);
  EXPECT_DOUBLE_EQ(data->Rig().camera.fx, 100);
  EXPECT_EQ(data->Rig().camera.width, 64);
  EXPECT_DOUBLE_EQ(data->Rig().baseline_m, 0.5);
  EXPECT_NEAR(data->Rig().rate_hz, 10, 1e-9);
  EXPECT_DOUBLE_EQ(data->Stamp(3), 0.3);
  const InputFrame frame = FrameOf(*data, 2);
  EXPECT_EQ(Difference(frame.image, Picture(64, 48, 2)), 0);
  EXPECT_EQ(Difference(frame.right, Picture(64, 48, 102)), 0);
  ASSERT_TRUE(data->GroundTruthFile());
  const Trajectory truth = data->ReadGroundTruth(*data->GroundTruthFile(), nullptr);
  ASSERT_EQ(truth.size(), 4U);
  EXPECT_DOUBLE_EQ(truth[3].stamp_s, 0.3);
  EXPECT_DOUBLE_EQ(truth[3].pose.translation.x(), 3);
}

TEST(DatasetTest, StrideKeepsIndicesAndStampsOfTheData) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 7, false);
  DatasetOptions options = With(Sensor::kMono);
  options.stride = 3;
  const auto data = OpenDataset(folder, options);
  ASSERT_EQ(data->Size(), 3U);
  EXPECT_EQ(data->Read(2).frame->index, 6);
  EXPECT_DOUBLE_EQ(data->Stamp(2), 0.6);
  EXPECT_EQ(data->ReadGroundTruth(folder / "poses.txt", nullptr).size(), 7U);
}

TEST(DatasetTest, ANumberIsThePlaceAmongTheImagesWhateverTheirNamesAndRefusedLines) {
  const auto folder = FreshFolder();
  MakeKitti(folder / "kitti", 7, false);
  for (const char* name : {"000000.png", "000001.png"})
    std::filesystem::remove(folder / "kitti" / "image_0" / name);
  const auto cut = OpenDataset(folder / "kitti", With(Sensor::kMono));
  ASSERT_EQ(cut->Size(), 5U);
  EXPECT_EQ(cut->Read(1).frame->index, 1);
  EXPECT_DOUBLE_EQ(cut->Stamp(1), 0.3);
  std::string list;
  for (int i = 0; i < 4; ++i) {
    const std::string name = std::to_string(i) + ".png", stamp = i == 1 ? "0" : std::to_string(i);
    WriteImage(folder / "icl" / name, Picture(64, 48, i));
    list.append(stamp).append(".0 " + name + " ").append(stamp).append(".0 depth.png\n");
  }
  WriteText(folder / "icl" / "associations.txt", list);
  DatasetOptions options = With(Sensor::kMono, true);
  options.start = 1;
  const auto listed = OpenDataset(folder / "icl", options);  // the second line repeats a stamp
  ASSERT_EQ(listed->Size(), 2U);
  EXPECT_EQ(listed->Number(0), 1);
  EXPECT_EQ(listed->Read(0).frame->index, 1);
  EXPECT_EQ(Difference(listed->Read(0).frame->image, Picture(64, 48, 2)), 0);
}

TEST(DatasetTest, StartEndAndStrideChooseFramesThatKeepTheirNumbers) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 10, true);
  DatasetOptions options = With(Sensor::kStereo);
  options.start = 1;
  options.end = 8;
  options.stride = 3;
  const auto data = OpenDataset(folder, options);
  ASSERT_EQ(data->Size(), 3U);  // 1, 4, 7
  for (std::size_t i = 0; i < 3; ++i) {
    const std::int64_t number = 1 + 3 * static_cast<std::int64_t>(i);
    const InputFrame read = FrameOf(*data, i);
    EXPECT_EQ(read.index, number);
    EXPECT_EQ(data->Number(i), number);
    EXPECT_DOUBLE_EQ(data->Stamp(i), 0.1 * static_cast<double>(number));
    EXPECT_EQ(Difference(read.image, Picture(64, 48, static_cast<int>(number))), 0);
    EXPECT_EQ(FindStamp(*data, data->Stamp(i)), i);
  }
  EXPECT_FALSE(FindStamp(*data, 0.2));
  EXPECT_FALSE(FindStamp(*data, 0.9));
  EXPECT_FALSE(data->WaitFor(3, [] { return false; }));
  EXPECT_NEAR(data->Rig().rate_hz, 10.0 / 3, 1e-9);
  EXPECT_EQ(data->ReadGroundTruth(folder / "poses.txt", nullptr).size(), 10U);
  options.end = 100;  // beyond the last: to the last
  EXPECT_EQ(OpenDataset(folder, options)->Size(), 3U);
}

TEST(DatasetTest, NoiseIsTheSameForADrawAndAnotherForTheNext) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 3, true);
  DatasetOptions options = With(Sensor::kStereo);
  options.noise = 4;
  const auto image = [&](int draw, std::size_t i, bool right) {
    options.noise_draw = draw;
    const ReadResult read = OpenDataset(folder, options)->Read(i);
    return right ? read.frame->right : read.frame->image;
  };
  const auto deviation = [](const cv::Mat& a, const cv::Mat& b) {
    return cv::norm(a, b, cv::NORM_L2) / std::sqrt(static_cast<double>(a.total()));
  };
  EXPECT_EQ(deviation(image(0, 1, false), image(0, 1, false)), 0);
  EXPECT_NEAR(deviation(image(0, 1, false), Picture(64, 48, 1)), 4, 1);  // some are cut off at 0 and 255
  EXPECT_NEAR(deviation(image(0, 1, false), image(1, 1, false)), 4 * std::sqrt(2), 1.5);
  // Neither the two cameras nor two frames have the same noise.
  const cv::Mat left = image(0, 1, false) - Picture(64, 48, 1),
                right = image(0, 1, true) - Picture(64, 48, 101);
  EXPECT_GT(deviation(left, right), 1);
}

TEST(DatasetTest, ReadsAnyImageFormat) {
  for (const char* extension : {".jpg", ".webp", ".bmp", ".pgm", ".tif"}) {
    const auto folder = FreshFolder();
    MakeKitti(folder, 2, false, extension);
    EXPECT_TRUE(OpenDataset(folder, With(Sensor::kMono))->Read(1).frame) << extension;
  }
}

TEST(DatasetTest, ColourBecomesGreyAndSixteenBitIsScaled) {
  const auto folder = FreshFolder();
  cv::Mat colour;
  cv::cvtColor(Picture(64, 48, 0), colour, cv::COLOR_GRAY2BGR);
  WriteImage(folder / "1.png", colour);
  const auto data = OpenDataset(folder, With(Sensor::kMono));
  EXPECT_EQ(data->Read(0).frame->image.type(), CV_8UC1);
  EXPECT_LE(Difference(data->Read(0).frame->image, Picture(64, 48, 0)), 1);

  const auto deep_folder = folder / "deep";
  WriteImage(deep_folder / "1.png", Picture(64, 48, 0, CV_16UC1));  // 12 bit
  const auto deep = OpenDataset(deep_folder, With(Sensor::kMono));
  EXPECT_LE(Difference(deep->Read(0).frame->image, Picture(64, 48, 0)), 1);
  EXPECT_THAT(deep->Warnings(), ::testing::Contains(HasSubstr("12-bit")));
}

TEST(DatasetTest, SixteenBitImagesOfANarrowRangeAreStretched) {
  const auto folder = FreshFolder();
  for (int i = 0; i < 5; ++i) {  // a thermal camera: 7000 to 7255 of 16384
    cv::Mat image;
    Picture(64, 48, i).convertTo(image, CV_16U, 1, 7000);
    WriteImage(folder / (std::to_string(i) + ".png"), image);
  }
  const auto data = OpenDataset(folder, With(Sensor::kMono));
  double low = 0, high = 0;
  cv::minMaxLoc(data->Read(4).frame->image, &low, &high);
  EXPECT_GT(high - low, 100);  // 4 without
  EXPECT_THAT(data->Warnings(), ::testing::Contains(HasSubstr("narrow range")));
  // One scale for all: equal temperatures stay equal.
  WriteImage(folder / "5.png", cv::Mat(48, 64, CV_16UC1, cv::Scalar(7128)));
  const auto again = OpenDataset(folder, With(Sensor::kMono));
  EXPECT_NEAR(again->Read(5).frame->image.at<unsigned char>(0, 0), 128, 4);
}

TEST(DatasetTest, TumAssociatesEachDepthImageOnceByTime) {
  const auto folder = FreshFolder();
  std::string rgb = "# timestamp filename\n", depth = "# timestamp filename\n";
  const double colour_at[] = {1.00, 1.03, 1.06, 1.09};
  const double depth_at[] = {1.01, 1.035, 1.20};
  for (int i = 0; i < 4; ++i) {
    const std::string name = "rgb/" + std::to_string(i) + ".png";
    WriteImage(folder / name, Picture(64, 48, i));
    rgb += std::to_string(colour_at[i]) + " " + name + "\n";
  }
  for (int i = 0; i < 3; ++i) {
    const std::string name = "depth/" + std::to_string(i) + ".png";
    WriteImage(folder / name, cv::Mat(48, 64, CV_16UC1, cv::Scalar(5000 * (i + 1))));
    depth += std::to_string(depth_at[i]) + " " + name + "\n";
  }
  WriteText(folder / "rgb.txt", rgb);
  WriteText(folder / "depth.txt", depth);
  DatasetOptions options = With(Sensor::kRgbd, true);
  const auto data = OpenDataset(folder, options);
  ASSERT_EQ(data->Size(), 4U);
  EXPECT_THAT(data->Warnings()[0], HasSubstr("2 of 4"));
  EXPECT_EQ(data->Read(1).frame->depth_m.type(), CV_32FC1);
  EXPECT_FLOAT_EQ(data->Read(0).frame->depth_m.at<float>(5, 5), 1.0F);
  EXPECT_FLOAT_EQ(data->Read(1).frame->depth_m.at<float>(5, 5), 2.0F);
  for (const std::size_t i : {2U, 3U}) {  // colour alone
    const ReadResult read = data->Read(i);
    ASSERT_TRUE(read.frame) << read.error;
    EXPECT_TRUE(read.frame->depth_m.empty());
    EXPECT_TRUE(read.depth_error.empty()) << read.depth_error;
    EXPECT_EQ(read.frame->index, static_cast<std::int64_t>(i));
    EXPECT_EQ(Difference(read.frame->image, Picture(64, 48, static_cast<int>(i))), 0);
  }
  options.max_depth_m = 1.5;
  EXPECT_FLOAT_EQ(OpenDataset(folder, options)->Read(1).frame->depth_m.at<float>(5, 5), 0.0F);
  EXPECT_EQ(OpenDataset(folder, With(Sensor::kMono, true))->Size(), 4U);
}

TEST(DatasetTest, IclNuimHasDepthFirstFrameNumbersForStampsAndMirroredTruth) {
  const auto folder = FreshFolder();
  std::string list;
  for (int i = 1; i < 4; ++i) {
    const std::string n = std::to_string(i);
    WriteImage(folder / "rgb" / (n + ".png"), Picture(64, 48, i));
    WriteImage(folder / "depth" / (n + ".png"), cv::Mat(48, 64, CV_16UC1, cv::Scalar(5000)));
    list.append(n).append(" depth/" + n + ".png ").append(n).append(" rgb/" + n + ".png\n");
  }
  WriteText(folder / "associations.txt", list);
  WriteText(folder / "livingRoom0.gt.freiburg",
            "1 0 1 0 0 0 0 1\n2 0 2 0 0.1 0 0 0.99\n3 0 3 0 0 0.1 0 0.99\n");
  DatasetOptions options = With(Sensor::kRgbd, true);
  options.camera->fy = -60;  // as published
  const auto data = OpenDataset(folder, options);
  EXPECT_NEAR(data->Stamp(1), 2.0 / 30, 1e-9);
  EXPECT_EQ(Difference(data->Read(1).frame->image, Picture(64, 48, 2)), 0);
  EXPECT_GT(data->Rig().camera.fy, 0);
  const Trajectory truth = data->ReadGroundTruth(*data->GroundTruthFile(), nullptr);
  EXPECT_NEAR(truth[1].stamp_s, data->Stamp(1), 1e-9);
  EXPECT_DOUBLE_EQ(truth[1].pose.translation.y(), -2);
  EXPECT_LT(truth[1].pose.rotation.x(), 0);
  EXPECT_GT(truth[2].pose.rotation.y(), 0);
}

TEST(DatasetTest, FolderOfImagesComesInNaturalOrderWithoutStrayPictures) {
  const auto folder = FreshFolder();
  for (int i = 1; i <= 12; ++i) WriteImage(folder / (std::to_string(i) + ".png"), Picture(64, 48, i));
  WriteImage(folder / "ground_truth.bmp", Picture(12, 12, 0));
  const auto data = OpenDataset(folder, With(Sensor::kMono));
  ASSERT_EQ(data->Size(), 12U);
  EXPECT_EQ(Difference(data->Read(9).frame->image, Picture(64, 48, 10)), 0);
  EXPECT_FALSE(data->Rig().calibrated);
  EXPECT_TRUE(OpenDataset(folder, With(Sensor::kMono, true))->Rig().calibrated);
}

TEST(DatasetTest, ImagesThatAreNamedByTheirTimesHaveTheseInTheirOrder) {
  const auto stamps = [](const std::vector<std::string>& names) {
    const auto folder = FreshFolder();
    for (const std::string& name : names) WriteImage(folder / (name + ".png"), Picture(64, 48, 1));
    std::string truth;
    for (int k = 0; k < 4; ++k) truth += std::to_string(1403636579 + k) + " " + std::to_string(k) + " 0 0\n";
    WriteText(folder / "groundtruth.txt", truth);  // in seconds, positions alone
    const auto data = OpenDataset(folder, With(Sensor::kMono, true));
    EXPECT_THAT(data->Warnings(), ::testing::Contains(HasSubstr("time stamps that they are called by")));
    EXPECT_NEAR(data->ReadGroundTruth(folder / "groundtruth.txt", nullptr)[1].stamp_s, 1403636580, 1e-6);
    std::vector<double> out;
    for (std::size_t i = 0; i < data->Size(); ++i) out.push_back(data->Stamp(i));
    return out;
  };
  using ::testing::DoubleNear;
  using ::testing::ElementsAre;
  EXPECT_THAT(stamps({"1403636579763555584", "1403636579813555456"}),
              ElementsAre(DoubleNear(1403636579.763555584, 1e-6), DoubleNear(1403636579.813555456, 1e-6)));
  EXPECT_THAT(stamps({"frame_1403636579.8", "frame_1403636579.763556"}),
              ElementsAre(1403636579.763556, 1403636579.8));
  EXPECT_THAT(stamps({"-50000000", "-100000000", "0", "50000000"}),
              ElementsAre(DoubleNear(-0.1, 1e-9), DoubleNear(-0.05, 1e-9), 0, DoubleNear(0.05, 1e-9)));
}

TEST(DatasetTest, ListsOfImagesDepthAndPosesMayBeInAnyUnitOfTime) {
  const auto folder = FreshFolder();
  const auto list = [&](const char* name, const char* of, double per_second, double late_s) {
    std::string text = "timestamp filename\n";
    for (int k = 0; k < 5; ++k) {
      const std::string file = std::string(of) + "/" + std::to_string(k) + ".png";
      text += std::to_string((1403636579 + 0.05 * k + late_s) * per_second) + " " + file + "\n";
      WriteImage(folder / file,
                 of == std::string("rgb") ? Picture(64, 48, k) : cv::Mat(48, 64, CV_16UC1, cv::Scalar(5000)));
    }
    WriteText(folder / name, text);
  };
  for (const double images : {1.0, 1e3, 1e6, 1e9}) {
    for (const double others : {1.0, 1e3, 1e6, 1e9}) {
      list("rgb.txt", "rgb", images, 0);
      list("depth.txt", "depth", others, 0.004);
      WriteText(folder / "groundtruth.txt", std::to_string(1403636579 * others) + " 0 0 0 0 0 0 1\n" +
                                                std::to_string(1403636579.05 * others) + " 1 0 0 0 0 0 1\n");
      const auto data = OpenDataset(folder, With(Sensor::kRgbd, true));
      ASSERT_EQ(data->Size(), 5U);
      EXPECT_NEAR(data->Stamp(4), 1403636579.2, 1e-5);
      EXPECT_FALSE(data->Read(4).frame->depth_m.empty());
      std::vector<std::string> warnings = data->Warnings();
      EXPECT_NEAR(data->ReadGroundTruth(folder / "groundtruth.txt", &warnings)[1].stamp_s, 1403636579.05,
                  1e-5);
      const bool truth_is_usual = others == 1 || others == images;
      const int said = (images != 1 ? 1 : 0) + (others != images ? 1 : 0) + (truth_is_usual ? 0 : 1);
      const auto of_units = std::count_if(warnings.begin(), warnings.end(), [](const std::string& w) {
        return w.find("time stamps are in") != std::string::npos;
      });
      EXPECT_EQ(of_units, said) << images << " " << others;
    }
  }
}

TEST(DatasetTest, AssociationsWhoseStampsNameTheImagesAreNanosecondsAndNoFrameNumbers) {
  const auto folder = FreshFolder();
  std::string list;
  for (const std::string n : {"1403636579763555584", "1403636579813555456"}) {
    WriteImage(folder / "rgb" / (n + ".png"), Picture(64, 48, 1));
    WriteImage(folder / "depth" / (n + ".png"), cv::Mat(48, 64, CV_16UC1, cv::Scalar(5000)));
    list += n + " rgb/" + n + ".png " + n + " depth/" + n + ".png\n";
  }
  WriteText(folder / "associations.txt", list);
  EXPECT_NEAR(OpenDataset(folder, With(Sensor::kRgbd, true))->Stamp(1), 1403636579.813555456, 1e-6);
}

TEST(DatasetTest, KittiTimesMayBeInNanosecondsAndPosesNumbered) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 4, false);
  WriteText(folder / "times.txt", "0\n100000000\n200000000\n300000000\n");
  WriteText(folder / "poses.txt", "1 1 0 0 5 0 1 0 6 0 0 1 7\n3 1 0 0 5 0 1 0 6 0 0 1 8\n");  // KITTI-360
  const auto data = OpenDataset(folder, With(Sensor::kMono));
  EXPECT_NEAR(data->Stamp(3), 0.3, 1e-9);
  const Trajectory truth = data->ReadGroundTruth(folder / "poses.txt", nullptr);
  ASSERT_EQ(truth.size(), 2U);
  EXPECT_NEAR(truth[1].stamp_s, 0.3, 1e-9);
  EXPECT_EQ(truth[1].pose.translation.z(), 8);
}

TEST(DatasetTest, VideoGivesTheSameFramesInAnyOrder) {
  const auto file = FreshFolder() / "clip.avi";
  std::vector<cv::Mat> images;
  for (int i = 0; i < 20; ++i) images.emplace_back(48, 64, CV_8UC3, cv::Scalar::all(10 * i));
  if (!testing::WriteMotionJpeg(file, images)) GTEST_SKIP() << "this OpenCV can't write a video";
  const auto data = OpenDataset(file, With(Sensor::kMono));
  ASSERT_EQ(data->Size(), 20U);
  EXPECT_NEAR(data->Stamp(5), 0.2, 1e-9);
  for (const std::size_t i : {0U, 7U, 3U, 19U, 1U}) {
    const InputFrame frame = FrameOf(*data, i);
    EXPECT_NEAR(frame.image.at<unsigned char>(20, 20), 10.0 * static_cast<double>(i), 3);
  }
}

TEST(DatasetTest, ReadsTheSameFromSeveralThreads) {
  const auto folder = FreshFolder();
  MakeKitti(folder, 8, true);
  const auto data = OpenDataset(folder, With(Sensor::kStereo));
  std::vector<int> bad(2, 0);
  std::vector<std::thread> threads;
  threads.reserve(2);
  for (int t = 0; t < 2; ++t) {
    threads.emplace_back([&, t] {
      for (int k = 0; k < 40; ++k) {
        const int i = (k * (t + 1)) % 8;
        const ReadResult r = data->Read(static_cast<std::size_t>(i));
        if (!r.frame || cv::norm(r.frame->image, Picture(64, 48, i), cv::NORM_INF) != 0)
          ++bad[static_cast<std::size_t>(t)];
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(bad[0] + bad[1], 0);
}

TEST(DatasetTest, RealKittiHead) {
  TUTTI_REQUIRE_DATA(path, "kitti_00_head");
  const auto data = OpenDataset(path, With(Sensor::kMono));
  EXPECT_EQ(data->Size(), 1700U);
  EXPECT_NEAR(data->Rig().camera.fx, 718.856, 1e-6);
  EXPECT_EQ(data->Read(1699).frame->image.size(), cv::Size(1241, 376));
  EXPECT_EQ(data->ReadGroundTruth(*data->GroundTruthFile(), nullptr).size(), 1700U);
  EXPECT_THAT(OpenError(path, With(Sensor::kStereo)), HasSubstr("image_1"));
}

TEST(DatasetTest, RealRedkitchen) {
  TUTTI_REQUIRE_DATA(path, "redkitchen");
  DatasetOptions options = With(Sensor::kRgbd, true);
  options.camera->width = 640;
  options.camera->height = 480;
  const auto data = OpenDataset(path, options);
  EXPECT_EQ(data->Size(), 500U);
  const InputFrame frame = FrameOf(*data, 100);
  double most = 0;
  cv::minMaxLoc(frame.depth_m, nullptr, &most);
  EXPECT_GT(most, 1);
  EXPECT_LT(most, 14);
}

TEST(DatasetTest, RealCorridorHas84Images) {
  TUTTI_REQUIRE_DATA(path, "corridor");
  EXPECT_EQ(OpenDataset(path, With(Sensor::kMono))->Size(), 84U);
}

// After rectification a point has the same row in both images.
TEST(DatasetTest, RealEurocPairsAreRectified) {
  TUTTI_REQUIRE_DATA(path, "euroc_v101_head");
  const auto data = OpenDataset(path, With(Sensor::kStereo));
  ASSERT_EQ(data->Size(), 95U);
  EXPECT_NEAR(data->Rig().baseline_m, 0.11, 0.001);
  const InputFrame read = FrameOf(*data, 50);
  const auto orb = cv::ORB::create(1500);
  std::vector<cv::KeyPoint> left, right;
  cv::Mat left_descriptors, right_descriptors;
  orb->detectAndCompute(read.image, cv::noArray(), left, left_descriptors);
  orb->detectAndCompute(read.right, cv::noArray(), right, right_descriptors);
  std::vector<cv::DMatch> matches;
  cv::BFMatcher(cv::NORM_HAMMING, true).match(left_descriptors, right_descriptors, matches);
  std::vector<double> rows;
  for (const cv::DMatch& m : matches) {
    const cv::Point2f d =
        left[static_cast<std::size_t>(m.queryIdx)].pt - right[static_cast<std::size_t>(m.trainIdx)].pt;
    if (m.distance < 40 && d.x > 0) rows.push_back(std::abs(d.y));
  }
  ASSERT_GT(rows.size(), 100U);
  std::nth_element(rows.begin(), rows.begin() + static_cast<long>(rows.size() / 2), rows.end());
  EXPECT_LE(rows[rows.size() / 2], 0.6);
}

}  // namespace
}  // namespace tutti
