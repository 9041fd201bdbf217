#include "apps/tutti/loops/joined_pairs.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>

#include "frontend/dataset/image_file.h"
#include "tutti/core/error.h"

namespace tutti::cli {

std::vector<std::filesystem::path> TakeRightImages(const std::string& folder,
                                                   std::vector<std::filesystem::path>& images) {
  if (images.size() % 2 != 0) {
    throw InputError(
        folder + ": has " + std::to_string(images.size()) +
        " images, but --join-pairs needs pairs of a left and a right one; add the missing image");
  }
  std::vector<std::filesystem::path> left, right;
  for (std::size_t i = 0; i < images.size(); i += 2) {
    left.push_back(images[i]);
    right.push_back(images[i + 1]);
  }
  images = std::move(left);
  return right;
}

cv::Mat ReadJoined(const std::filesystem::path& left, const std::filesystem::path& right,
                   std::vector<cv::Rect>* cameras) {
  const cv::Mat a = ReadImageFile(left, cv::IMREAD_UNCHANGED).image;
  const cv::Mat b = ReadImageFile(right, cv::IMREAD_UNCHANGED).image;
  if (a.empty() || b.empty() || a.type() != b.type()) return {};
  cv::Mat joined = cv::Mat::zeros(std::max(a.rows, b.rows), a.cols + b.cols, a.type());
  const cv::Rect in_left(0, 0, a.cols, a.rows), in_right(a.cols, 0, b.cols, b.rows);
  a.copyTo(joined(in_left));
  b.copyTo(joined(in_right));
  if (cameras != nullptr) *cameras = {in_left, in_right};
  return joined;
}

}  // namespace tutti::cli
