#include "frontend/features/features.h"

#include <cstring>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/inner_loops.h"
#include "core/intensity_centroid.h"
#include "core/orb_description.h"

namespace tutti {
namespace {

constexpr int kBorder = internal::OrbDescription::kMargin;        // [px]
constexpr int kHalfPatch = internal::IntensityCentroid::kRadius;  // [px]

// The patch of the orientation: a disc.
const internal::IntensityCentroid& OrientationPatch() {
  static const internal::IntensityCentroid patch = [] {
    internal::IntensityCentroid::HalfWidths widths{};
    for (int v = 0; v <= kHalfPatch; ++v)
      widths[static_cast<std::size_t>(v)] =
          static_cast<int>(std::lround(std::sqrt(double(kHalfPatch * kHalfPatch - v * v))));
    return internal::IntensityCentroid(widths);
  }();
  return patch;
}

// Sub-pixel corner: the point that is nearest to all the lines through the window's pixels along their edges
// (Foerstner & Guelch 1987); the integer position where that is not well defined or more than a pixel away.
cv::Point2f RefineCorner(const cv::Mat& image, const cv::Point2f& corner) {
  constexpr int kWindow = 3;
  const int x = static_cast<int>(corner.x), y = static_cast<int>(corner.y);
  float a = 0, b = 0, c = 0, p = 0, q = 0;
  for (int v = -kWindow; v <= kWindow; ++v) {
    const std::uint8_t* row = image.ptr<std::uint8_t>(y + v) + x;
    const std::uint8_t* above = image.ptr<std::uint8_t>(y + v - 1) + x;
    const std::uint8_t* below = image.ptr<std::uint8_t>(y + v + 1) + x;
    for (int u = -kWindow; u <= kWindow; ++u) {
      const float gx = static_cast<float>(row[u + 1] - row[u - 1]),
                  gy = static_cast<float>(below[u] - above[u]);
      const float xx = gx * gx, xy = gx * gy, yy = gy * gy;
      const float fu = static_cast<float>(u), fv = static_cast<float>(v);
      a += xx;
      b += xy;
      c += yy;
      p += xx * fu + xy * fv;
      q += xy * fu + yy * fv;
    }
  }
  const float determinant = a * c - b * b, trace = a + c;
  if (determinant < 0.02F * trace * trace) return corner;  // an edge: free along its direction
  const float du = (c * p - b * q) / determinant, dv = (a * q - b * p) / determinant;
  if (std::abs(du) > 1 || std::abs(dv) > 1) return corner;
  return {corner.x + du, corner.y + dv};
}

// The pixel of a mask that stands for this place.
const std::uint8_t& MaskAt(const cv::Mat& mask, const cv::Point2f& p) {
  const int x = std::clamp(static_cast<int>(std::lround(p.x)), 0, mask.cols - 1);
  const int y = std::clamp(static_cast<int>(std::lround(p.y)), 0, mask.rows - 1);
  return mask.at<std::uint8_t>(y, x);
}

bool IsMaskedAt(const cv::Mat& mask, const cv::Point2f& p) { return !mask.empty() && MaskAt(mask, p) == 0; }

// What the mask says of the places of a level's pixels.
template <class InImage>
cv::Mat MaskOfLevel(const cv::Mat& mask, cv::Size size, const InImage& in_image) {
  if (mask.empty() || mask.size() == size) return mask;
  cv::Mat level(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x)
      level.at<std::uint8_t>(y, x) = MaskAt(mask, in_image({static_cast<float>(x), static_cast<float>(y)}));
  }
  return level;
}

std::vector<int> FeaturesPerLevel(const OdometryOptions& options) {
  // A geometric series: each level gets features in proportion to its side length.
  const double factor = 1.0 / options.scale_factor;
  const int levels = options.pyramid_levels;
  double share = options.features * (1 - factor) / (1 - std::pow(factor, levels));
  std::vector<int> out;
  int sum = 0;
  for (int l = 0; l + 1 < levels; ++l) {
    out.push_back(static_cast<int>(std::lround(share)));
    sum += out.back();
    share *= factor;
  }
  out.push_back(std::max(0, options.features - sum));
  return out;
}

inline int PopCount(std::uint64_t x) {
  x = x - ((x >> 1) & 0x5555555555555555ULL);
  x = (x & 0x3333333333333333ULL) + ((x >> 2) & 0x3333333333333333ULL);
  x = (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0fULL;
  return static_cast<int>((x * 0x0101010101010101ULL) >> 56);
}

}  // namespace

TUTTI_CLONES("popcnt")
int HammingDistance(const std::uint8_t* a, const std::uint8_t* b) {
  int distance = 0;
  for (int i = 0; i < 32; i += 8) {
    std::uint64_t x, y;
    std::memcpy(&x, a + i, 8);
    std::memcpy(&y, b + i, 8);
    distance += PopCount(x ^ y);
  }
  return distance;
}

float DepthImage::InverseAt(int x, int y) const {
  if (x < 1 || y < 1 || x + 1 >= metres.cols || y + 1 >= metres.rows) return 0;
  const float z = metres.at<float>(y, x);
  if (!(z > 0.05F) || (max_m > 0 && z > max_m)) return 0;
  bool edge = false;
  for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
    const float n = metres.at<float>(y + dy, x + dx);
    edge |= n > 0 && std::abs(1 / n - 1 / z) > 6 * static_cast<float>(inverse_sigma);
  }
  return edge ? -1.0F / z : 1.0F / z;
}

void FrameFeatures::BuildGrid(int width, int height) {
  columns_ = width / kCell + 1;
  rows_ = height / kCell + 1;
  FillGrid();
}

void FrameFeatures::FillGrid() {
  std::vector<std::size_t> cell_of(keypoints.size());
  first_entry_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
  // Outside of the image, the cell at its edge.
  const auto cell_at = [](float pixel, int cells) {
    return pixel > 0 ? static_cast<int>(std::min(pixel, static_cast<float>(cells * kCell - 1))) / kCell : 0;
  };
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const int cell = cell_at(keypoints[i].pt.y, rows_) * columns_ + cell_at(keypoints[i].pt.x, columns_);
    cell_of[i] = static_cast<std::size_t>(cell);
    ++first_entry_[cell_of[i] + 1];
  }
  std::partial_sum(first_entry_.begin(), first_entry_.end(), first_entry_.begin());
  entries_.resize(keypoints.size());
  std::vector<int> next(first_entry_.begin(), first_entry_.end() - 1);
  for (std::size_t i = 0; i < keypoints.size(); ++i)
    entries_[static_cast<std::size_t>(next[cell_of[i]]++)] = {keypoints[i].pt, keypoints[i].octave,
                                                              static_cast<int>(i)};
}

void FrameFeatures::InArea(const cv::Point2f& centre, float radius, int first_octave, int last_octave,
                           std::vector<int>* out) const {
  out->clear();
  ForEachInArea(centre, radius, first_octave, last_octave,
                [out](const cv::Point2f&, int, int feature) { out->push_back(feature); });
}

std::shared_ptr<const FrameFeatures> WithoutImages(const FrameFeatures& features) {
  auto out = std::make_shared<FrameFeatures>(features);
  out->pyramid.reset();
  out->depth_grid.reset();
  out->depth_image.reset();
  return out;
}

std::vector<float> PyramidScales(const OdometryOptions& options) {
  std::vector<float> scales;
  scales.reserve(static_cast<std::size_t>(std::max(0, options.pyramid_levels)));
  for (int l = 0; l < options.pyramid_levels; ++l)
    scales.push_back(static_cast<float>(std::pow(options.scale_factor, l)));
  return scales;
}

std::vector<cv::Mat> BuildPyramid(const cv::Mat& image, const OdometryOptions& options) {
  std::vector<cv::Mat> pyramid{image};
  for (int l = 1; l < options.pyramid_levels; ++l) {
    const double scale = std::pow(options.scale_factor, -l);
    const cv::Size size(static_cast<int>(std::lround(image.cols * scale)),
                        static_cast<int>(std::lround(image.rows * scale)));
    if (size.width < 2 * kBorder + 2 || size.height < 2 * kBorder + 2) break;
    pyramid.push_back(NextLevel(pyramid.back(), size));
  }
  return pyramid;
}

FrameFeatures ExtractOrb(const std::vector<cv::Mat>& pyramid, const OdometryOptions& options,
                         const cv::Mat& mask) {
  FrameFeatures out;
  if (pyramid.empty() || pyramid[0].empty()) return out;
  const std::vector<float> scales = PyramidScales(options);
  const std::vector<int> wanted = FeaturesPerLevel(options);
  std::vector<cv::Mat> descriptors;
  for (std::size_t l = 0; l < pyramid.size(); ++l) {
    const cv::Mat& image = pyramid[l];
    // With the scales of the options, or without the half pixel, coarse features are biased by more than a
    // pixel, and mono scale drifts with them.
    const auto in_image = [s = LevelScale(pyramid[0], image)](const cv::Point2f& p) {
      return cv::Point2f((p.x + 0.5F) * s.x - 0.5F, (p.y + 0.5F) * s.y - 0.5F);
    };
    std::vector<cv::KeyPoint> corners =
        DetectCorners(image, {wanted[l], options.fast_threshold, options.fast_threshold_min, kBorder},
                      MaskOfLevel(mask, image.size(), in_image));
    if (corners.empty()) continue;
    const internal::OrbDescription description(image);
    cv::Mat level_descriptors(static_cast<int>(corners.size()), internal::OrbDescription::kBytes, CV_8UC1);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      cv::KeyPoint& k = corners[i];
      const int x = static_cast<int>(k.pt.x), y = static_cast<int>(k.pt.y);
      k.angle = OrientationPatch().Angle(image, x, y);
      k.size = 2 * kHalfPatch + 1;
      description.Describe(x, y, k.angle, level_descriptors.ptr(static_cast<int>(i)));
    }
    descriptors.push_back(level_descriptors);
    for (cv::KeyPoint k : corners) {
      const cv::Point2f refined = in_image(RefineCorner(image, k.pt));
      k.octave = static_cast<int>(l);
      k.pt = IsMaskedAt(mask, refined) ? in_image(k.pt) : refined;
      k.size *= scales[l];
      out.keypoints.push_back(k);
    }
  }
  if (!descriptors.empty()) cv::vconcat(descriptors, out.descriptors);
  out.inverse_depth.assign(out.keypoints.size(), 0.0F);
  out.inverse_depth_sigma.assign(out.keypoints.size(), 0.0F);
  out.aligned.assign(out.keypoints.size(), -1);
  out.BuildGrid(pyramid[0].cols, pyramid[0].rows);
  return out;
}

namespace {

void AddDepthFromImage(const DepthImage& depth, FrameFeatures* features) {
  for (std::size_t i = 0; i < features->size(); ++i) {
    const cv::Point2f& p = features->keypoints[i].pt;
    const int x = static_cast<int>(std::lround(p.x)), y = static_cast<int>(std::lround(p.y));
    const float inverse = depth.InverseAt(x, y);
    if (!(inverse > 0)) continue;
    features->inverse_depth[i] = inverse;
    features->inverse_depth_sigma[i] = static_cast<float>(depth.inverse_sigma);
  }
}

// About 2000 elements: enough for any image that is aligned by them.
std::shared_ptr<const DepthGrid> GridOf(const DepthImage& depth, const cv::Mat& mask) {
  constexpr int kElements = 2000, kFinest = 8;  // [px]
  auto grid = std::make_shared<DepthGrid>();
  const double area = double(depth.metres.cols) * depth.metres.rows;
  grid->step = std::max(kFinest, static_cast<int>(std::lround(std::sqrt(area / kElements))));
  grid->columns = depth.metres.cols / grid->step;
  const int rows = depth.metres.rows / grid->step;
  if (rows < 1 || grid->columns < 1) return nullptr;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < grid->columns; ++c) {
      const int x = grid->step / 2 + c * grid->step, y = grid->step / 2 + r * grid->step;
      const bool masked = !mask.empty() && mask.at<std::uint8_t>(y, x) == 0;
      grid->inverse_depth.push_back(masked ? 0 : depth.InverseAt(x, y));
    }
  }
  return grid;
}

}  // namespace

FrameFeatures ExtractFeatures(const InputFrame& frame, const CameraRig& rig, const OdometryOptions& options) {
  const auto shared = std::make_shared<const Pyramid>(BuildPyramid(frame.image, options));
  const std::vector<cv::Mat>& pyramid = shared->Levels();
  FrameFeatures features = ExtractOrb(pyramid, options, frame.mask);
  features.pyramid = shared;
  features.has_depth = !frame.depth_m.empty() || !frame.right.empty();
  if (!frame.depth_m.empty()) {
    DepthImage depth{frame.depth_m, frame.depth_later_s - rig.depth_delay_s, rig.max_depth_m,
                     options.rgbd_inverse_sigma};
    features.depth_later_s = frame.depth_later_s;
    AddDepthFromImage(depth, &features);
    features.depth_grid = GridOf(depth, frame.mask);
    // Time stamps alone say too little of when depth was taken: those of a Kinect are 15 ms off.
    if (rig.depth_delay_s != 0) features.depth_image = std::make_shared<const DepthImage>(std::move(depth));
  }
  if (!frame.right.empty()) {
    const std::vector<cv::Mat> right_pyramid = BuildPyramid(frame.right, options);
    const FrameFeatures right = ExtractOrb(right_pyramid, options);
    MatchStereo(pyramid, right_pyramid, right, rig, options, &features);
  }
  return features;
}

}  // namespace tutti
