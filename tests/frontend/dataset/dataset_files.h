// Small data sets on disk for tests of the readers.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "frontend/dataset/image_file.h"
#include "frontend/dataset/rectified_rig.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/frontend/dataset.h"

namespace tutti::testing {

inline void WriteText(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << text;
}

/// An image with structure, different for each `number`.
inline cv::Mat Picture(int width, int height, int number, int type = CV_8UC1) {
  cv::Mat image(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      image.at<unsigned char>(y, x) = static_cast<unsigned char>(x * 7 + y * y + 31 * number);
  }
  if (type == CV_16UC1) image.convertTo(image, CV_16U, 16);
  return image;
}

inline void WriteImage(const std::filesystem::path& file, const cv::Mat& image) {
  std::filesystem::create_directories(file.parent_path());
  cv::imwrite(file.string(), image);
}

inline void Truncate(const std::filesystem::path& file, double part) {
  std::filesystem::resize_file(
      file, static_cast<std::uintmax_t>(part * static_cast<double>(std::filesystem::file_size(file))));
}

inline const char* const kCalibration =
    "P0: 100 0 32 0 0 100 24 0 0 0 1 0\nP1: 100 0 32 -50 0 100 24 0 0 0 1 0\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n";

/// KITTI layout with n frames of 64x48.
inline void MakeKitti(const std::filesystem::path& folder, int n, bool stereo,
                      const std::string& extension = ".png") {
  std::string times, poses;
  for (int i = 0; i < n; ++i) {
    const std::string name = "00000" + std::to_string(i) + extension;
    WriteImage(folder / "image_0" / name, Picture(64, 48, i));
    if (stereo) WriteImage(folder / "image_1" / name, Picture(64, 48, i + 100));
    times += std::to_string(0.1 * i) + "\n";
    poses += "1 0 0 " + std::to_string(i) + " 0 1 0 0 0 0 1 0\n";
  }
  WriteText(folder / "times.txt", times);
  WriteText(folder / "poses.txt", poses);
  WriteText(folder / "calib.txt", kCalibration);
}

inline PinholeCamera SmallCamera() { return Pinhole(60, 60, 32, 24, {64, 48}); }

/// The message of the InputError that opening throws; "no error" if it throws none.
inline std::string OpenError(const std::filesystem::path& folder, const DatasetOptions& options) {
  return ErrorOf([&] { OpenDataset(folder, options); });
}

/// Frame i, which must be there.
inline InputFrame FrameOf(const Dataset& data, std::size_t i) {
  const ReadResult read = data.Read(i);
  EXPECT_TRUE(read.frame) << read.error;
  return read.frame.value_or(InputFrame());
}

/// Greatest difference of two images' pixels.
inline double Difference(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() ? cv::norm(a, b, cv::NORM_INF) : 1e9;
}

/// Motion JPEG (.avi), which loses a little. False if this OpenCV can't.
inline bool WriteMotionJpeg(const std::filesystem::path& file, const std::vector<cv::Mat>& images,
                            double rate_hz = 25) {
  cv::VideoWriter writer(file.string(), cv::CAP_OPENCV_MJPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'),
                         rate_hz, images.front().size());
  for (const cv::Mat& image : images) writer.write(ToColour(image));
  return writer.isOpened();
}

inline DatasetOptions With(Sensor sensor, bool camera = false) {
  DatasetOptions options;
  options.sensor = sensor;
  if (camera) options.camera = SmallCamera();
  return options;
}

}  // namespace tutti::testing
