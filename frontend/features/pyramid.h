// The image of a frame at several sizes.
#pragma once

#include <functional>
#include <mutex>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

namespace tutti {

/// An image and its smaller ones. Those of a saved map are made when they are first asked for: of most maps
/// that are loaded they never are.
class Pyramid {
 public:
  Pyramid() = default;
  /// CV_8UC1; level 0 is the image.
  explicit Pyramid(std::vector<cv::Mat> levels) : levels_(std::move(levels)) {}

  /// Any thread may ask.
  const std::vector<cv::Mat>& Levels() const;
  /// For saved maps; defined in frontend/store/features_state.h.
  template <class Archive>
  void State(Archive& archive);

 private:
  mutable std::once_flag made_;
  mutable std::function<std::vector<cv::Mat>()> make_;  // null: they are there
  mutable std::vector<cv::Mat> levels_;
};

/// The level of a pyramid after `image`.
cv::Mat NextLevel(const cv::Mat& image, const cv::Size& size);

}  // namespace tutti
