// Not in features.cc: the thread sanitizer has to see this.
#include <opencv2/imgproc.hpp>

#include "frontend/features/features.h"

namespace tutti {

const std::vector<cv::Mat>& Pyramid::Levels() const {
  std::call_once(made_, [this] {
    if (make_) levels_ = make_();
    make_ = nullptr;
  });
  return levels_;
}

cv::Mat NextLevel(const cv::Mat& image, const cv::Size& size) {
  cv::Mat level;
  cv::resize(image, level, size, 0, 0, cv::INTER_LINEAR);
  return level;
}

}  // namespace tutti
