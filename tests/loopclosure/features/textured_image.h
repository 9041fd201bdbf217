// Deterministic images with many corners, for tests.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

namespace tutti::testing {

/// Grey image of random rectangles and discs; another seed is another place.
inline cv::Mat TexturedImage(std::uint32_t seed, int width = 320, int height = 240) {
  std::mt19937 generator(seed);
  const auto draw = [&](int low, int high) {
    return low + static_cast<int>(generator() % static_cast<std::uint32_t>(high - low));
  };
  cv::Mat image(height, width, CV_8UC1, cv::Scalar(draw(90, 160)));
  const int shapes = width * height / 400;
  for (int i = 0; i < shapes; ++i) {
    const int y = draw(0, height), x = draw(0, width);
    const cv::Point centre(x, y);
    const int size = draw(3, 18);
    const cv::Scalar grey(draw(0, 255));
    if (draw(0, 2) == 0) {
      cv::circle(image, centre, size / 2 + 1, grey, cv::FILLED);
    } else {
      cv::rectangle(image, cv::Rect(centre.x, centre.y, size, draw(3, 18)), grey, cv::FILLED);
    }
  }
  cv::GaussianBlur(image, image, cv::Size(0, 0), 0.8);
  return image;
}

/// The place is seen again from a little further right and turned by a degree.
inline cv::Mat SeenAgain(const cv::Mat& image) {
  cv::Mat motion = cv::getRotationMatrix2D(cv::Point2f(image.cols * 0.5f, image.rows * 0.5f), 1.0, 1.03);
  motion.at<double>(0, 2) += 4.0;
  cv::Mat moved;
  cv::warpAffine(image, moved, motion, image.size(), cv::INTER_LINEAR, cv::BORDER_REFLECT);
  return moved;
}

}  // namespace tutti::testing
