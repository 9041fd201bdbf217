// Two cameras (video files in their stead), and one whose images hold two.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf, ::testing::ElementsAre, ::testing::HasSubstr;
using testing::Difference, testing::FrameOf, testing::FreshFolder, testing::OpenError, testing::Picture,
    testing::With, testing::WriteImage;

bool NeverStop() { return false; }

// Without loss. False if this OpenCV can't.
bool WriteVideo(const fs::path& file, const std::vector<cv::Mat>& images) {
  cv::VideoWriter writer(file.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('F', 'F', 'V', '1'), 25,
                         images.front().size(), false);
  if (!writer.isOpened()) return false;
  for (const cv::Mat& image : images) writer.write(image);
  return true;
}

std::vector<cv::Mat> Pictures(int count, int first, int width = 64) {
  std::vector<cv::Mat> images(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) images[static_cast<std::size_t>(i)] = Picture(width, 48, first + i);
  return images;
}

DatasetOptions RectifiedPair() {
  DatasetOptions options = With(Sensor::kStereo, true);
  options.baseline_m = 0.5;
  return options;
}

class CameraPair : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = FreshFolder();
    if (!WriteVideo(folder_ / "left.mkv", Pictures(5, 0)) ||
        !WriteVideo(folder_ / "right.mkv", Pictures(5, 100)))
      GTEST_SKIP() << "this OpenCV can't write a video without loss";
  }
  std::string Name(const std::string& first, const std::string& second) const {
    return "camera:" + (folder_ / first).string() + "," + (folder_ / second).string();
  }
  fs::path folder_;
};

TEST_F(CameraPair, OfRectifiedFilesGivesTheFramesOfAFolder) {
  testing::MakeKitti(folder_ / "kitti", 5, true);
  DatasetOptions options = RectifiedPair();
  options.camera->fx = options.camera->fy = 100;
  const auto wanted = OpenDataset(folder_ / "kitti", With(Sensor::kStereo));
  const auto live = OpenDataset(Name("left.mkv", "right.mkv"), options);
  EXPECT_EQ(live->FrameSupply(), Supply::kOnce);
  EXPECT_EQ(live->Rig().sensor, Sensor::kStereo);
  EXPECT_EQ(live->Rig().baseline_m, wanted->Rig().baseline_m);
  EXPECT_EQ(live->Rig().camera.Matrix(), wanted->Rig().camera.Matrix());
  EXPECT_EQ(live->Rig().rate_hz, 25);
  for (std::size_t i = 0; i < 5; ++i) {
    ASSERT_TRUE(live->WaitFor(i, NeverStop));
    const ReadResult read = live->Read(i), other = wanted->Read(i);
    ASSERT_TRUE(read.frame.has_value()) << read.error;
    EXPECT_EQ(read.depth_error, "");
    EXPECT_NEAR(read.frame->stamp_s, static_cast<double>(i) / 25, 1e-9);
    EXPECT_EQ(Difference(read.frame->image, other.frame->image), 0);
    EXPECT_EQ(Difference(read.frame->right, other.frame->right), 0);
  }
  EXPECT_FALSE(live->WaitFor(5, NeverStop));
  EXPECT_THAT(live->Read(0).error, HasSubstr("come once"));
}

TEST_F(CameraPair, InOneImageIsCutInTheMiddle) {
  std::vector<cv::Mat> both(5);
  for (int i = 0; i < 5; ++i)
    cv::hconcat(Picture(64, 48, i), Picture(64, 48, 100 + i), both[static_cast<std::size_t>(i)]);
  ASSERT_TRUE(WriteVideo(folder_ / "both.mkv", both));
  DatasetOptions options = RectifiedPair();
  options.mask = (folder_ / "mask.png").string();
  WriteImage(options.mask, cv::Mat(48, 64, CV_8UC1, cv::Scalar(255)));  // as large as one of the two
  const auto dataset = OpenDataset("camera:" + (folder_ / "both.mkv").string(), options);
  EXPECT_TRUE(dataset->Warnings().empty());
  EXPECT_EQ(dataset->Rig().camera.width, 64);
  EXPECT_EQ(dataset->Rig().baseline_m, 0.5);
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(dataset->WaitFor(static_cast<std::size_t>(i), NeverStop));
    const InputFrame read = FrameOf(*dataset, static_cast<std::size_t>(i));
    EXPECT_EQ(Difference(read.image, Picture(64, 48, i)), 0);
    EXPECT_EQ(Difference(read.right, Picture(64, 48, 100 + i)), 0);
    EXPECT_EQ(read.mask.size(), cv::Size(64, 48));
  }
}

TEST_F(CameraPair, OfASingleImageCutInTheMiddleIsTold) {
  DatasetOptions options = With(Sensor::kStereo);
  const auto dataset = OpenDataset("camera:" + (folder_ / "left.mkv").string(), options);
  ASSERT_EQ(dataset->Warnings().size(), 2u);
  EXPECT_THAT(dataset->Warnings()[0], HasSubstr("taken as two images of 32x48 side by side"));
  EXPECT_THAT(dataset->Warnings()[1], HasSubstr("no calibration is given"));
  EXPECT_FALSE(dataset->Rig().calibrated);
}

// Two cameras with lenses, turned against each other, that see bright points.
struct RawPair {
  RawPair() {
    left = Pinhole(200, 200, 158, 121, {320, 240});
    left.distortion = Distortion::kRadTan;
    left.coefficients = {-0.2, 0.05, 0.001, -0.001, 0};
    right = left;
    right.fx = right.fy = 205;
    right.cx = 163;
    right.coefficients = {-0.18, 0.04, -0.001, 0.001, 0};
    T_right_left = Pose(ExpSO3({0.03, -0.02, 0.04}), {-0.12, 0.004, -0.003});
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) points.emplace_back(0.7 * x, 0.5 * y, 2 + 0.3 * x + 0.2 * y);
    }
  }
  static cv::Mat View(const PinholeCamera& camera, const std::vector<Eigen::Vector3d>& points) {
    cv::Mat image(camera.height, camera.width, CV_8UC1, cv::Scalar(0));
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector2d at = camera.Project(point);
      constexpr int kShift = 8;  // of OpenCV's fixed point
      cv::circle(image, cv::Point(cvRound(at.x() * 256), cvRound(at.y() * 256)), 3 << kShift, cv::Scalar(255),
                 cv::FILLED, cv::LINE_AA, kShift);
    }
    return image;
  }
  cv::Mat LeftImage() const { return View(left, points); }
  cv::Mat RightImage() const {
    std::vector<Eigen::Vector3d> seen;
    for (const Eigen::Vector3d& point : points) seen.push_back(T_right_left * point);
    return View(right, seen);
  }
  DatasetOptions Options() const {
    DatasetOptions options;
    options.sensor = Sensor::kStereo;
    options.camera = left;
    options.right = right;
    const Eigen::Matrix4d T = T_right_left.Matrix();
    for (int i = 0; i < 16; ++i) options.T_right_left[static_cast<std::size_t>(i)] = T(i / 4, i % 4);
    return options;
  }

  PinholeCamera left, right;
  Pose T_right_left;
  std::vector<Eigen::Vector3d> points;  // of the left camera's frame
};

// Middle of what is bright near `at`.
Eigen::Vector2d Middle(const cv::Mat& image, const Eigen::Vector2d& at) {
  constexpr int kRadius = 9;
  const cv::Rect around(cvRound(at.x()) - kRadius, cvRound(at.y()) - kRadius, 2 * kRadius + 1,
                        2 * kRadius + 1);
  if ((around & cv::Rect(0, 0, image.cols, image.rows)) != around) return {-100, -100};
  const cv::Moments m = cv::moments(image(around));
  return m.m00 > 0 ? Eigen::Vector2d(around.x + m.m10 / m.m00, around.y + m.m01 / m.m00)
                   : Eigen::Vector2d(-100, -100);
}

TEST_F(CameraPair, ThatIsRawIsRectifiedSoThatRowsAgree) {
  const RawPair pair;
  ASSERT_TRUE(WriteVideo(folder_ / "raw_left.mkv", {pair.LeftImage()}));
  ASSERT_TRUE(WriteVideo(folder_ / "raw_right.mkv", {pair.RightImage()}));
  const auto dataset = OpenDataset(Name("raw_left.mkv", "raw_right.mkv"), pair.Options());
  const CameraRig& rig = dataset->Rig();
  EXPECT_NEAR(rig.baseline_m, pair.T_right_left.translation.norm(), 1e-9);
  EXPECT_EQ(rig.camera.distortion, Distortion::kNone);
  const InputFrame read = FrameOf(*dataset, 0);
  for (const Eigen::Vector3d& point : pair.points) {
    const Eigen::Vector3d rectified = rig.T_body_camera.Inverse() * point;
    const Eigen::Vector2d wanted = rig.camera.Project(rectified);
    const Eigen::Vector2d disparity(rig.camera.fx * rig.baseline_m / rectified.z(), 0);
    const Eigen::Vector2d left = Middle(read.image, wanted);
    const Eigen::Vector2d right = Middle(read.right, wanted - disparity);
    EXPECT_NEAR((left - wanted).norm(), 0, 0.3) << wanted.transpose();
    EXPECT_NEAR((right - wanted + disparity).norm(), 0, 0.3) << wanted.transpose();
    EXPECT_NEAR(left.y(), right.y(), 0.2);
  }
}

TEST_F(CameraPair, OfColourAndDepthIsInMetres) {
  for (int i = 0; i < 5; ++i) {
    cv::Mat depth(48, 64, CV_16UC1, cv::Scalar(5000 + i));
    depth.at<std::uint16_t>(3, 5) = 60000;
    WriteImage(folder_ / "depth" / (std::to_string(i) + ".png"), depth);
  }
  DatasetOptions options = With(Sensor::kRgbd, true);
  options.depth_units_per_m = 1000;
  options.max_depth_m = 20;
  const auto dataset = OpenDataset(Name("left.mkv", "depth"), options);
  EXPECT_EQ(dataset->Rig().sensor, Sensor::kRgbd);
  EXPECT_EQ(dataset->Rig().max_depth_m, 20);
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(dataset->WaitFor(static_cast<std::size_t>(i), NeverStop));
    const InputFrame read = FrameOf(*dataset, static_cast<std::size_t>(i));
    EXPECT_EQ(Difference(read.image, Picture(64, 48, i)), 0);
    EXPECT_TRUE(read.right.empty());
    ASSERT_EQ(read.depth_m.type(), CV_32FC1);
    EXPECT_FLOAT_EQ(read.depth_m.at<float>(2, 5), 5.0F + 0.001F * static_cast<float>(i));
    EXPECT_EQ(read.depth_m.at<float>(3, 5), 0) << "is beyond max_depth_m";
  }
  options.rotate = 90;
  const auto turned = OpenDataset(Name("left.mkv", "depth"), options);
  EXPECT_EQ(turned->Read(0).frame->depth_m.size(), cv::Size(48, 64));
}

TEST_F(CameraPair, WhoseSecondEndsEarlierGoesOnWithoutIt) {
  ASSERT_TRUE(WriteVideo(folder_ / "short.mkv", Pictures(3, 100)));
  const auto dataset = OpenDataset(Name("left.mkv", "short.mkv"), RectifiedPair());
  for (std::size_t i = 0; i < 5; ++i) {
    ASSERT_TRUE(dataset->WaitFor(i, NeverStop));
    const ReadResult read = dataset->Read(i);
    ASSERT_TRUE(read.frame.has_value()) << read.error;
    EXPECT_EQ(read.frame->right.empty(), i >= 3);
    if (i < 3)
      EXPECT_EQ(read.depth_error, "");
    else
      EXPECT_THAT(read.depth_error, AllOf(HasSubstr("frame " + std::to_string(i) + " has no right image"),
                                          HasSubstr("short.mkv ended after 3 images")));
  }
  EXPECT_FALSE(dataset->WaitFor(5, NeverStop));
  const auto other = OpenDataset(Name("short.mkv", "left.mkv"), RectifiedPair());
  EXPECT_TRUE(other->WaitFor(2, NeverStop));
  EXPECT_FALSE(other->WaitFor(3, NeverStop)) << "the left images are the frames";
}

TEST_F(CameraPair, WithAFileThatHasACommaInItsNameIsOneFile) {
  ASSERT_TRUE(WriteVideo(folder_ / "a,b.mkv", Pictures(2, 7)));
  const std::string name = "camera:" + (folder_ / "a,b.mkv").string();
  EXPECT_THAT(CameraSources(name), ElementsAre((folder_ / "a,b.mkv").string()));
  EXPECT_EQ(
      Difference(OpenDataset(name, With(Sensor::kMono, true))->Read(0).frame->image, Picture(64, 48, 7)), 0);
}

TEST_F(CameraPair, ThatDoesNotFitTogetherIsRefused) {
  ASSERT_TRUE(WriteVideo(folder_ / "small.mkv", Pictures(2, 0, 62)));
  // FFmpeg makes widths even.
  cv::VideoWriter odd((folder_ / "odd.avi").string(), cv::CAP_OPENCV_MJPEG,
                      cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, cv::Size(63, 48), false);
  odd.write(Picture(63, 48, 0));
  odd.release();
  WriteImage(folder_ / "depth" / "0.png", cv::Mat(48, 62, CV_16UC1, cv::Scalar(5000)));
  EXPECT_THAT(OpenError(Name("left.mkv", "small.mkv"), RectifiedPair()),
              AllOf(HasSubstr("left.mkv gives images of 64x48"), HasSubstr("small.mkv of 62x48")));
  EXPECT_THAT(OpenError(Name("left.mkv", "depth"), With(Sensor::kRgbd, true)),
              AllOf(HasSubstr("depth of 62x48"), HasSubstr("must be registered to colour")));
  EXPECT_THAT(OpenError("camera:" + (folder_ / "odd.avi").string(), RectifiedPair()),
              AllOf(HasSubstr("63x48"), HasSubstr("odd width")));
  EXPECT_THAT(OpenError(Name("left.mkv", "right.mkv"), With(Sensor::kRgbd, true)),
              AllOf(HasSubstr("right.mkv"), HasSubstr("gives no 16-bit images"), HasSubstr("ffmpeg -i")));
  EXPECT_THAT(OpenError(Name("left.mkv", "nowhere.mkv"), RectifiedPair()),
              HasSubstr("nowhere.mkv: can't be opened"));
  EXPECT_THAT(
      OpenError(Name("left.mkv", "right.mkv"), With(Sensor::kStereo, true)),
      AllOf(HasSubstr("left.mkv"), HasSubstr("distance of the two cameras"), HasSubstr("camera.baseline_m")));
  DatasetOptions turned = RectifiedPair();
  turned.rotate = 90;
  EXPECT_THAT(OpenError(Name("left.mkv", "right.mkv"), turned), HasSubstr("can't be turned"));
}

TEST(CameraPairNames, AreTwoWithACommaInBetween) {
  EXPECT_TRUE(IsCameraDevice("camera:0,1"));
  EXPECT_FALSE(IsCameraDevice("camera:0,right.mkv"));
  EXPECT_FALSE(IsCameraDevice("camera:0,"));
  EXPECT_THAT(CameraSources("camera:0,1"), ElementsAre("0", "1"));
  EXPECT_THAT(CameraSources("camera:l.mkv,r.mkv"), ElementsAre("l.mkv", "r.mkv"));
  EXPECT_THAT(CameraSources("rtsp://robot/a,b"), ElementsAre("rtsp://robot/a,b"));
  EXPECT_TRUE(CameraSources("video.mkv").empty());
}

TEST(CameraPairNames, ThatDoNotFitTheSensorAreRefused) {
  const DatasetOptions mono = With(Sensor::kMono, true);
  EXPECT_THAT(OpenError("camera:0,1", mono), HasSubstr("names two cameras, but sensor is mono"));
  EXPECT_THAT(OpenError("camera:0,1,2", RectifiedPair()), HasSubstr("names 3 cameras"));
  EXPECT_THAT(OpenError("camera:0,", RectifiedPair()), HasSubstr("a camera has no name"));
  EXPECT_THAT(OpenError("camera:", mono), HasSubstr("a camera has no name"));
  EXPECT_THAT(OpenError("camera:0,0", RectifiedPair()), HasSubstr("names the same camera twice"));
  EXPECT_THAT(OpenError("camera:0,right.mkv", RectifiedPair()), HasSubstr("one is a device and one a file"));
  EXPECT_THAT(OpenError("camera:0", With(Sensor::kRgbd, true)), HasSubstr("RGB-D needs two cameras"));
  EXPECT_THAT(OpenError("camera:998,999", RectifiedPair()), HasSubstr("/dev/video998"));
}

}  // namespace
}  // namespace tutti
