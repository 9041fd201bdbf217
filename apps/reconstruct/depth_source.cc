#include "apps/reconstruct/depth_source.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/calib3d.hpp>
#include <vector>

#include "core/numbers.h"
#include "frontend/dataset/image_file.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

class SensorDepth : public DepthSource {
 public:
  explicit SensorDepth(const Dataset& dataset) : dataset_(dataset) {}

  DepthImageRead Read(const PosedFrame& frame) const override {
    const ReadResult read = dataset_.Read(frame.place);
    if (!read.frame) return {{}, read.error, 0};
    if (read.frame->depth_m.empty())
      return {{}, read.depth_error.empty() ? "it has no depth image" : read.depth_error, 0};
    return {read.frame->depth_m, {}, read.frame->depth_later_s - dataset_.Rig().depth_delay_s};
  }

 private:
  const Dataset& dataset_;
};

class StereoDepth : public DepthSource {
 public:
  explicit StereoDepth(const Dataset& dataset) : dataset_(dataset) {}

  DepthImageRead Read(const PosedFrame& frame) const override {
    const ReadResult read = dataset_.Read(frame.place);
    if (!read.frame) return {{}, read.error, 0};
    if (read.frame->right.empty())
      return {{}, read.depth_error.empty() ? "it has no right image" : read.depth_error, 0};
    const CameraRig& rig = dataset_.Rig();
    return {DepthOfPair(read.frame->image, read.frame->right, rig.camera.fx, rig.baseline_m), {}, 0};
  }

 private:
  const Dataset& dataset_;
};

class DepthFromFiles : public DepthSource {
 public:
  DepthFromFiles(const Dataset& dataset, const MapModel& model, const fs::path& folder) : model_(model) {
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
      if (entry.is_regular_file() && entry.path().filename().string().front() != '.')
        files_.push_back(entry.path());
    }
    if (error) throw InputError("--depth " + folder.string() + ": " + error.message());
    std::sort(files_.begin(), files_.end(), [](const fs::path& a, const fs::path& b) {
      return NaturalLess(a.filename().string(), b.filename().string());
    });
    std::size_t images = 0;
    for (std::size_t i = 0; i < dataset.Size(); ++i) {
      numbers_.push_back(static_cast<std::size_t>(dataset.Number(i)));
      images = numbers_.back() + 1;
    }
    if (files_.size() < images)
      throw InputError("--depth " + folder.string() + ": has " + std::to_string(files_.size()) +
                       " files, but the data set " + std::to_string(images) +
                       " images; give a depth image for each, in the order of their names");
    for (const ModelLandmark& landmark : model.landmarks) landmarks_[landmark.id] = landmark.position;
  }

  DepthImageRead Read(const PosedFrame& frame) const override {
    const fs::path& file = files_[numbers_[frame.place]];
    const ImageFile read = ReadDepthFile(file);
    if (!read.error.empty()) return {{}, read.error, 0};
    const cv::Size size(model_.camera.width, model_.camera.height);
    if (read.image.size() != size)
      return {{},
              file.string() + ": is " + std::to_string(read.image.cols) + "x" +
                  std::to_string(read.image.rows) + ", the images are " + std::to_string(size.width) + "x" +
                  std::to_string(size.height),
              0};
    cv::Mat depth;
    read.image.convertTo(depth, CV_32FC1);
    std::string problem;
    const double scale = ScaleOf(depth, *frame.keyframe, &problem);
    if (!problem.empty()) return {{}, file.string() + ": " + problem, 0};
    return {depth * scale, {}, 0};
  }
  bool KeyframesOnly() const override { return true; }

 private:
  // What the depth is to be multiplied by, so that it is that of the landmarks.
  double ScaleOf(const cv::Mat& depth, const ModelKeyframe& keyframe, std::string* problem) const {
    constexpr std::size_t kLeast = 20;
    constexpr double kMostScatter = 0.15;
    const Pose T_camera_world = keyframe.T_world_camera.Inverse();
    std::vector<double> ratios;
    for (const SeenLandmark& view : keyframe.views) {
      const int u = static_cast<int>(std::lround(view.pixel.x)),
                v = static_cast<int>(std::lround(view.pixel.y));
      if (u < 0 || v < 0 || u >= depth.cols || v >= depth.rows) continue;
      const auto there = static_cast<double>(depth.at<float>(v, u));
      const double z = (T_camera_world * landmarks_.at(view.landmark)).z();
      if (there > 0 && std::isfinite(there)) ratios.push_back(z / there);
    }
    if (ratios.size() < kLeast) {
      *problem = "only " + std::to_string(ratios.size()) +
                 " landmarks lie where it has depth; its scale is not known";
      return 0;
    }
    const double median = internal::Median(ratios);
    for (double& ratio : ratios) ratio = std::abs(ratio / median - 1);
    if (const double scatter = internal::Median(ratios); scatter > kMostScatter) {
      *problem = "its depth and that of the landmarks differ by " +
                 std::to_string(std::lround(100 * scatter)) +
                 " % in the median after scaling; it is not depth along z, or not of this image";
      return 0;
    }
    return median;
  }

  const MapModel& model_;
  std::vector<fs::path> files_;
  std::vector<std::size_t> numbers_;  // of the data set's frames
  std::map<int, Eigen::Vector3d> landmarks_;
};

}  // namespace

cv::Mat DepthOfPair(const cv::Mat& left, const cv::Mat& right, double fx, double baseline_m) {
  constexpr int kStep = 16;  // of the matcher's range
  const int disparities = kStep * std::max(1, static_cast<int>(std::ceil(fx / 5 / kStep)));
  constexpr int kWindow = 5, kSmooth = kWindow * kWindow, kMostDifference = 1, kUnique = 10, kSpeck = 100;
  // Left and right must agree within kMostDifference.
  const auto matcher = cv::StereoSGBM::create(0, disparities, kWindow, 8 * kSmooth, 32 * kSmooth,
                                              kMostDifference, 0, kUnique, kSpeck, 2);
  cv::Mat sixteenths;
  matcher->compute(left, right, sixteenths);
  const double scale = 16 * fx * baseline_m;
  cv::Mat depth = cv::Mat::zeros(sixteenths.size(), CV_32FC1);
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const int disparity = sixteenths.at<std::int16_t>(v, u);
      if (disparity > 0) depth.at<float>(v, u) = static_cast<float>(scale / disparity);
    }
  }
  return depth;
}

std::unique_ptr<DepthSource> OpenDepth(const Dataset& dataset, const MapModel& model,
                                       const std::optional<fs::path>& folder) {
  if (folder) return std::make_unique<DepthFromFiles>(dataset, model, *folder);
  switch (dataset.Rig().sensor) {
    case Sensor::kRgbd:
      return std::make_unique<SensorDepth>(dataset);
    case Sensor::kStereo:
      return std::make_unique<StereoDepth>(dataset);
    default:
      throw InputError(
          "one camera alone measures no depth. There are three ways to a dense map: a recording with depth "
          "images "
          "(tutti run --sensor rgbd), one of a stereo camera (--sensor stereo), or --depth DIR with a depth "
          "image "
          "for each image, as a network makes them");
  }
}

}  // namespace tutti
