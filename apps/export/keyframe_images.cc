#include "apps/export/keyframe_images.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <unordered_map>

#include "core/numbers.h"
#include "frontend/geometry/lens_error.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

bool SameCamera(const PinholeCamera& a, const PinholeCamera& b) {
  constexpr double kSame = 1e-6;  // [px]
  return a.width == b.width && a.height == b.height && std::abs(a.fx - b.fx) < kSame &&
         std::abs(a.fy - b.fy) < kSame && std::abs(a.cx - b.cx) < kSame && std::abs(a.cy - b.cy) < kSame;
}

// How far the camera has come at each keyframe: the sum of its steps, as shares of the whole way that it
// moved and of the whole angle that it turned.
std::vector<double> Ways(const std::vector<ModelKeyframe>& keyframes) {
  std::vector<double> moved(keyframes.size(), 0), turned(keyframes.size(), 0);
  for (std::size_t i = 1; i < keyframes.size(); ++i) {
    const Pose step = keyframes[i - 1].T_world_camera.Inverse() * keyframes[i].T_world_camera;
    moved[i] = moved[i - 1] + step.translation.norm();
    turned[i] = turned[i - 1] + step.Angle();
  }
  std::vector<double> ways(keyframes.size(), 0);
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    if (moved.back() > 0) ways[i] += moved[i] / moved.back();
    if (turned.back() > 0) ways[i] += turned[i] / turned.back();
  }
  return ways;
}

// Sharpness compared with the median of the neighbours, 1 for an image like them.
std::vector<double> RelativeSharpness(const std::vector<std::size_t>& candidates,
                                      const std::vector<std::optional<double>>& sharpness) {
  constexpr std::size_t kAround = 5;
  std::vector<double> relative;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    std::vector<double> around;
    for (std::size_t j = i - std::min(i, kAround); j < std::min(candidates.size(), i + kAround + 1); ++j)
      around.push_back(*sharpness[candidates[j]]);
    const double median = internal::Median(around);
    relative.push_back(median > 0 ? *sharpness[candidates[i]] / median : 1);
  }
  return relative;
}

}  // namespace

KeyframeImages::KeyframeImages(const Dataset& dataset, const MapModel& model)
    : dataset_(dataset), offset_(model.image_offset) {
  if (dataset.FrameSupply() == Supply::kOnce)
    throw InputError(
        "the images of a camera come only once and are gone; landmarks stay grey without them, "
        "and colmap and transforms need them: record the images, then run on the recording");
  if (!SameCamera(dataset.Rig().camera, model.camera))
    throw InputError(
        "the data set has another camera than the map (size, focal length or principal point); "
        "give the one that the map was made of");
  for (std::size_t i = 0; i < dataset.Size(); ++i) places_[dataset.Number(i)] = i;
  if (std::none_of(model.keyframes.begin(), model.keyframes.end(),
                   [this](const ModelKeyframe& keyframe) { return PlaceOf(keyframe); }))
    throw InputError(
        "the data set has no frame of the map, by number and time stamp; give the one that the "
        "map was made of");
  if (model.lens.isZero()) return;
  const PinholeCamera& camera = model.camera;
  from_x_.create(camera.height, camera.width, CV_32FC1);
  from_y_.create(camera.height, camera.width, CV_32FC1);
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector2d from = LensError::Uncorrect(camera, model.lens, {u, v});
      from_x_.at<float>(v, u) = static_cast<float>(from.x());
      from_y_.at<float>(v, u) = static_cast<float>(from.y());
    }
  }
}

std::optional<std::size_t> KeyframeImages::PlaceOf(const ModelKeyframe& keyframe) const {
  const auto place = places_.find(keyframe.frame_index - offset_);
  if (place == places_.end() || !(std::abs(dataset_.Stamp(place->second) - keyframe.stamp_s) < 1e-6))
    return std::nullopt;
  return place->second;
}

ColourImage KeyframeImages::Read(const ModelKeyframe& keyframe) const {
  const std::optional<std::size_t> place = PlaceOf(keyframe);
  if (!place)
    return {cv::Mat(), "the data set has no frame " + std::to_string(keyframe.frame_index) +
                           " with the time stamp that the map has for it"};
  ColourImage read = dataset_.ReadColour(*place);
  if (!read.error.empty() || from_x_.empty()) return read;
  cv::Mat moved;
  cv::remap(read.image, moved, from_x_, from_y_, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return {moved, {}};
}

double Sharpness(const cv::Mat& image) {
  cv::Mat grey = image, edges;
  if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  cv::Laplacian(grey, edges, CV_32F);
  cv::Scalar mean, deviation;
  cv::meanStdDev(edges, mean, deviation);
  return deviation[0] * deviation[0];
}

Looks LookAtImages(const KeyframeImages& images, MapModel* model) {
  struct Sum {
    std::array<long, 3> bgr = {};
    long views = 0;
  };
  std::unordered_map<int, Sum> sums;
  Looks looks;
  for (const ModelKeyframe& keyframe : model->keyframes) {
    const ColourImage read = images.Read(keyframe);
    if (!read.error.empty()) {
      looks.sharpness.emplace_back();
      looks.errors.push_back(read.error);
      continue;
    }
    looks.sharpness.emplace_back(Sharpness(read.image));
    for (const SeenLandmark& view : keyframe.views) {
      const int u = std::clamp(cvRound(view.pixel.x), 0, read.image.cols - 1);
      const int v = std::clamp(cvRound(view.pixel.y), 0, read.image.rows - 1);
      const auto& bgr = read.image.at<cv::Vec3b>(v, u);
      Sum& sum = sums[view.landmark];
      for (int c = 0; c < 3; ++c) sum.bgr[static_cast<std::size_t>(c)] += bgr[c];
      ++sum.views;
    }
  }
  for (ModelLandmark& landmark : model->landmarks) {
    const auto sum = sums.find(landmark.id);
    if (sum == sums.end()) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      const long rounded = (sum->second.bgr[2 - c] + sum->second.views / 2) / sum->second.views;
      landmark.rgb[c] = static_cast<std::uint8_t>(rounded);
    }
  }
  return looks;
}

std::vector<std::size_t> ChooseImages(const std::vector<ModelKeyframe>& keyframes,
                                      const std::vector<std::optional<double>>& sharpness, std::size_t most) {
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    if (sharpness[i]) chosen.push_back(i);
  }
  if (chosen.size() <= most) return chosen;
  const std::vector<double> ways = Ways(keyframes);
  std::vector<double> sharp = RelativeSharpness(chosen, sharpness);
  if (most == 1) {
    const auto best = std::max_element(sharp.begin(), sharp.end());
    return {chosen[static_cast<std::size_t>(best - sharp.begin())]};
  }
  while (chosen.size() > most) {
    std::ptrdiff_t least = 0;
    double least_missed = std::numeric_limits<double>::infinity();
    for (std::size_t i = 1; i + 1 < chosen.size(); ++i) {
      const double missed = (ways[chosen[i + 1]] - ways[chosen[i - 1]]) * sharp[i];
      if (missed >= least_missed) continue;
      least = static_cast<std::ptrdiff_t>(i);
      least_missed = missed;
    }
    chosen.erase(chosen.begin() + least);
    sharp.erase(sharp.begin() + least);
  }
  return chosen;
}

}  // namespace tutti
