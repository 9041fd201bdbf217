#include "tutti/loopclosure/features.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <tuple>

#include "core/numbers.h"
#include "loopclosure/features/orb.h"
#include "loopclosure/features/sift.h"
#include "loopclosure/features/smoothing.h"
#include "loopclosure/features/whole_image.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

constexpr double kImageBlur = 0.5;  // what an image is taken to be smoothed by [px]
// SURF and SIFT see an image of fewer pixels at twice its size: 240x192 has too few points for their quota.
constexpr int kSmallImage = 100000;
// SIFT's first octave is of no more pixels, whatever the other members see: it costs the most.
constexpr int kSiftMaxPixels = 1 << 19;
constexpr int kSurfOctaves = 4;  // of the Hessian pyramid, as in the ensemble's paper
// Determinants of the Hessian, in dlib's scale: points of the first are taken as they are. Where they are too
// few, weaker ones fill up in order of strength, down to the second, which a blank image's noise stays below.
constexpr double kSurfThreshold = 1.0, kSurfLeast = 0.05;

// How many points are to be detected for those that are kept: more, so that there is something to choose from
// when spreading.
int NumDetected(const ExtractionOptions& options) {
  constexpr int kOversampling = 2;
  return options.features * kOversampling;
}

std::vector<cv::KeyPoint> Picked(const std::vector<cv::KeyPoint>& keypoints,
                                 const std::vector<int>& selected) {
  std::vector<cv::KeyPoint> picked;
  picked.reserve(selected.size());
  for (const int i : selected) picked.push_back(keypoints[internal::Index(i)]);
  return picked;
}

// Keeps, of keypoints in order of strength, those that reach the threshold, or as many as are wanted.
void DropWeak(double threshold, int wanted, std::vector<cv::KeyPoint>& keypoints) {
  while (static_cast<int>(keypoints.size()) > wanted &&
         static_cast<double>(keypoints.back().response) < threshold) {
    keypoints.pop_back();
  }
}

void ScaleKeypoints(double factor, std::vector<cv::KeyPoint>& keypoints) {
  if (factor == 1.0) return;
  const float f = static_cast<float>(factor);
  for (cv::KeyPoint& keypoint : keypoints) {
    // Pixel centres: 0.5 of the small image's pixel is 0.5 * factor of the large one's.
    keypoint.pt = (keypoint.pt + cv::Point2f(0.5f, 0.5f)) * f - cv::Point2f(0.5f, 0.5f);
    keypoint.size *= f;
  }
}

using NamedFactory = std::pair<std::string, FeatureFactory>;

// What was registered in this process; `added`, if there is one, has joined it.
std::vector<NamedFactory> Registered(const NamedFactory* added = nullptr) {
  static std::mutex mutex;
  static std::vector<NamedFactory> types;
  const std::lock_guard<std::mutex> lock(mutex);
  if (added != nullptr) types.push_back(*added);
  return types;
}

// Factories of all members but surf, sift and orb; null for those and for an unknown name.
FeatureFactory FactoryOf(const std::string& name) {
  std::vector<NamedFactory> types = {{"akaze", [](cv::Size, int) { return cv::AKAZE::create(); }},
                                     {"brisk", [](cv::Size, int) { return cv::BRISK::create(); }},
                                     {"kaze", [](cv::Size, int) { return cv::KAZE::create(); }}};
  for (NamedFactory& type : Registered()) types.push_back(std::move(type));
  const auto found =
      std::find_if(types.begin(), types.end(), [&](const NamedFactory& type) { return type.first == name; });
  return found != types.end() ? found->second : nullptr;
}

}  // namespace

void RegisterFeatureType(const std::string& name, FeatureFactory factory) {
  const std::vector<std::string> known = KnownMembers();
  if (name.empty() || !factory || std::find(known.begin(), known.end(), name) != known.end()) {
    throw InputError("feature type '" + name +
                     "' can't be registered: the name is empty or taken, or there is no factory");
  }
  const NamedFactory added(name, std::move(factory));
  Registered(&added);
}

std::vector<std::string> KnownFeatureTypes() {
  std::vector<std::string> names = {"surf", "sift", "orb", "akaze", "brisk", "kaze"};
  for (const NamedFactory& type : Registered()) names.push_back(type.first);
  return names;
}

cv::Mat ToGrey8(const cv::Mat& image) {
  if (image.empty() || image.dims != 2) return {};
  cv::Mat grey = image;
  if (image.channels() == 3) {
    cv::cvtColor(image.depth() == CV_64F ? cv::Mat_<cv::Vec3f>(image) : image, grey, cv::COLOR_BGR2GRAY);
  } else if (image.channels() == 4) {
    cv::cvtColor(image.depth() == CV_64F ? cv::Mat_<cv::Vec4f>(image) : image, grey, cv::COLOR_BGRA2GRAY);
  } else if (image.channels() != 1) {
    cv::extractChannel(image, grey, 0);
  }
  if (grey.depth() == CV_8U) return grey;
  cv::Mat values;
  grey.convertTo(values, CV_32F);
  cv::patchNaNs(values, 0.0);
  double low = 0.0;
  double high = 0.0;
  cv::minMaxLoc(values, &low, &high);
  if (!std::isfinite(low) || !std::isfinite(high) || high <= low) return cv::Mat::zeros(grey.size(), CV_8U);
  cv::Mat result;
  values.convertTo(result, CV_8U, 255.0 / (high - low), -low * 255.0 / (high - low));
  return result;
}

bool IsMasked(const cv::Mat& mask, const cv::Point2f& pixel) {
  if (mask.empty()) return false;
  const int x = std::clamp(static_cast<int>(std::lround(pixel.x)), 0, mask.cols - 1);
  const int y = std::clamp(static_cast<int>(std::lround(pixel.y)), 0, mask.rows - 1);
  return mask.at<std::uint8_t>(y, x) == 0;
}

void DropMasked(const cv::Mat& mask, Features& features) {
  Features kept;
  for (std::size_t i = 0; i < features.keypoints.size(); ++i) {
    if (IsMasked(mask, features.keypoints[i].pt)) continue;
    kept.keypoints.push_back(features.keypoints[i]);
    kept.descriptors.push_back(features.descriptors.row(static_cast<int>(i)));
  }
  if (kept.keypoints.size() < features.keypoints.size()) features = std::move(kept);
}

std::vector<int> SelectSpread(const std::vector<cv::KeyPoint>& keypoints, cv::Size image_size, int count,
                              int columns) {
  std::vector<int> order(keypoints.size());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](int i) {
    const cv::KeyPoint& k = keypoints[internal::Index(i)];
    return std::make_tuple(-k.response, k.pt.y, k.pt.x, k.size, k.angle, i);
  };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
  if (static_cast<int>(order.size()) <= count) return order;

  const double cell =
      std::max(1.0, static_cast<double>(std::max(image_size.width, image_size.height)) / columns);
  const int cells_x = std::max(1, static_cast<int>(std::ceil(image_size.width / cell)));
  const int cells_y = std::max(1, static_cast<int>(std::ceil(image_size.height / cell)));
  const int share = std::max(1, count / (cells_x * cells_y));
  std::vector<int> taken(internal::Index(cells_x * cells_y), 0);
  std::vector<bool> chosen(order.size(), false);
  int num_chosen = 0;
  for (std::size_t i = 0; i < order.size() && num_chosen < count; ++i) {
    const cv::Point2f& p = keypoints[internal::Index(order[i])].pt;
    const int x = std::clamp(static_cast<int>(p.x / cell), 0, cells_x - 1);
    const int y = std::clamp(static_cast<int>(p.y / cell), 0, cells_y - 1);
    const int at = y * cells_x + x;
    int& used = taken[internal::Index(at)];
    if (used >= share) continue;
    ++used;
    chosen[i] = true;
    ++num_chosen;
  }
  for (std::size_t i = 0; i < order.size() && num_chosen < count; ++i) {
    if (chosen[i]) continue;
    chosen[i] = true;
    ++num_chosen;
  }
  std::vector<int> selected;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (chosen[i]) selected.push_back(order[i]);
  }
  return selected;
}

FeatureExtractor::FeatureExtractor(const std::string& name, const ExtractionOptions& options)
    : name_(name),
      options_(options),
      factory_(FactoryOf(name)),
      scratches_(std::make_shared<internal::SiftScratchPool>()) {
  const std::vector<std::string> known = KnownFeatureTypes();
  if (std::find(known.begin(), known.end(), name) == known.end()) {
    throw InputError("unknown member '" + name + "'; did you mean '" + NearestWord(name, known) + "'?");
  }
  if (name == "surf") {
    surf_ = CreateDlibSurf(NumDetected(options), kSurfOctaves, kSurfLeast);
  }
}

double FeatureExtractor::Shrinking(double pixels) const {
  double factor = std::max(1.0, std::sqrt(pixels / options_.max_pixels));
  if (name_ == "sift") factor = std::max(factor, std::sqrt(pixels / kSiftMaxPixels));
  const bool small = factor == 1.0 && pixels < kSmallImage;
  return small && (name_ == "surf" || name_ == "sift") ? 0.5 : factor;
}

Features FeatureExtractor::Extract(const cv::Mat& grey) const {
  Features features;
  if (grey.empty() || grey.type() != CV_8UC1 || std::min(grey.rows, grey.cols) < kMinSide) return features;
  const double factor = Shrinking(static_cast<double>(grey.total()));
  const cv::Mat cleared = internal::Cleared(grey);
  cv::Mat image = cleared;
  if (factor != 1.0) {
    const cv::Size size(cvRound(grey.cols / factor), cvRound(grey.rows / factor));
    if (std::min(size.width, size.height) < kMinSide) return features;
    cv::resize(cleared, image, size, 0, 0, factor > 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  }
  const auto spread = [&](const std::vector<cv::KeyPoint>& detected) {
    return SelectSpread(detected, image.size(), options_.features);
  };
  if (name_ == "sift") {
    std::unique_ptr<internal::SiftScratch> scratch = scratches_->Take();
    internal::SiftOptions wanted;
    wanted.features = options_.features;
    features = internal::ExtractSift(image, kImageBlur * std::max(1.0, 1.0 / factor), wanted, *scratch);
    scratches_->Give(std::move(scratch));
  } else if (name_ == "surf") {
    // Describing costs more than detecting, and what was detected stays valid: describe what is kept.
    std::vector<cv::KeyPoint> detected;
    surf_->detect(image, detected);
    DropWeak(kSurfThreshold, options_.features, detected);
    features.keypoints = Picked(detected, spread(detected));
    surf_->compute(image, features.keypoints, features.descriptors);
  } else if (name_ == "orb") {
    const internal::Orb orb(image, internal::OrbOptionsFor(image.size(), NumDetected(options_)));
    const std::vector<cv::KeyPoint> detected = orb.Detect();
    features.keypoints = Picked(detected, spread(detected));
    features.descriptors = orb.Describe(features.keypoints);
  } else {
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors;
    factory_(image.size(), NumDetected(options_))
        ->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
    if (keypoints.empty() || descriptors.rows != static_cast<int>(keypoints.size())) return features;
    const std::vector<int> selected = spread(keypoints);
    features.keypoints = Picked(keypoints, selected);
    features.descriptors.create(static_cast<int>(selected.size()), descriptors.cols, descriptors.type());
    for (std::size_t i = 0; i < selected.size(); ++i) {
      descriptors.row(selected[i]).copyTo(features.descriptors.row(static_cast<int>(i)));
    }
  }
  ScaleKeypoints(factor, features.keypoints);
  return features;
}

}  // namespace tutti
