#include "loopclosure/features/orb.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/fast_corners.h"
#include "core/intensity_centroid.h"
#include "core/numbers.h"
#include "core/orb_description.h"

namespace tutti::internal {
namespace {

constexpr float kScale = 1.2f;  // of a level to the next
constexpr int kPatch = 31;      // [px]
constexpr int kMostLevels = 8;
constexpr int kPadding = 23;  // what a level is mirrored by at its rim: more than a turned patch reaches [px]
static_assert(kPadding > IntensityCentroid::kMargin);
constexpr int kHarrisBlock = 7;  // window of a corner's response [px]
constexpr float kHarrisK = 0.04f;

float ScaleOf(int level) {
  return static_cast<float>(std::pow(static_cast<double>(kScale), static_cast<double>(level)));
}

// A level's share is in proportion to its side; the last has what is left. In cv::ORB's arithmetic: a share
// that is rounded otherwise would be another one.
std::vector<int> PointsPerLevel(int features, int levels) {
  const float factor = static_cast<float>(1.0 / static_cast<double>(kScale));
  float share = static_cast<float>(features) * (1 - factor) /
                (1 - static_cast<float>(std::pow(static_cast<double>(factor), static_cast<double>(levels))));
  std::vector<int> wanted;
  int sum = 0;
  for (int level = 0; level + 1 < levels; ++level) {
    wanted.push_back(cvRound(share));
    sum += wanted.back();
    share *= factor;
  }
  wanted.push_back(std::max(features - sum, 0));
  return wanted;
}

// cv::ORB's patch: a disc that is its own mirror image at the diagonal, too.
const IntensityCentroid& OrbPatch() {
  static const IntensityCentroid patch = [] {
    constexpr int kRadius = IntensityCentroid::kRadius;
    IntensityCentroid::HalfWidths widths{};
    const auto width = [&widths](int v) -> int& { return widths[Index(v)]; };
    const int diagonal = cvCeil(kRadius / std::sqrt(2.0));
    for (int v = 0; v < diagonal; ++v) width(v) = cvRound(std::sqrt(double(kRadius * kRadius - v * v)));
    for (int v = diagonal; v <= kRadius; ++v) {
      int u = diagonal - 1;
      while (width(u) < v) --u;
      width(v) = u;
    }
    return IntensityCentroid(widths);
  }();
  return patch;
}

// C. Harris, M. Stephens, "A combined corner and edge detector", 1988: Sobel's derivatives over the window
// around a pixel of a padded image, summed in whole numbers.
float HarrisResponse(const cv::Mat& padded, int x, int y) {
  constexpr int kHalf = kHarrisBlock / 2;
  constexpr int kRows = kHarrisBlock + 2;
  static const std::array<std::int16_t, 8> window{-1, -1, -1, -1, -1, -1, -1, 0};  // the eighth is beyond it
  const cv::v_int16x8 inside = cv::v_load(window.data());
  std::array<cv::v_int16x8, kRows> slope, sum;  // of each row: differences, and sums for those of columns
  for (int r = 0; r < kRows; ++r) {
    const std::uint8_t* row = padded.ptr(y - kHalf - 1 + r) + x - kHalf;
    const cv::v_int16x8 left = cv::v_reinterpret_as_s16(cv::v_load_expand(row - 1));
    const cv::v_int16x8 here = cv::v_reinterpret_as_s16(cv::v_load_expand(row));
    const cv::v_int16x8 right = cv::v_reinterpret_as_s16(cv::v_load_expand(row + 1));
    const auto at = Index(r);
    slope[at] = (right - left) & inside;
    sum[at] = (left + here + here + right) & inside;
  }
  cv::v_int32x4 xx = cv::v_setzero_s32(), yy = cv::v_setzero_s32(), xy = cv::v_setzero_s32();
  for (std::size_t r = 1; r + 1 < kRows; ++r) {
    const cv::v_int16x8 dx = slope[r - 1] + slope[r] + slope[r] + slope[r + 1];
    const cv::v_int16x8 dy = sum[r + 1] - sum[r - 1];
    xx = cv::v_dotprod(dx, dx, xx);
    yy = cv::v_dotprod(dy, dy, yy);
    xy = cv::v_dotprod(dx, dy, xy);
  }
  constexpr float kUnit = 1.0f / (4 * kHarrisBlock * 255.0f);
  const float a = static_cast<float>(cv::v_reduce_sum(xx)), b = static_cast<float>(cv::v_reduce_sum(yy)),
              c = static_cast<float>(cv::v_reduce_sum(xy));
  const float determinant = a * b - c * c, trace = a + b;
  return (determinant - kHarrisK * trace * trace) * (kUnit * kUnit * kUnit * kUnit);
}

// The pixel of its level that a keypoint is at.
cv::Point PixelOf(const cv::KeyPoint& keypoint, float scale) {
  return {cvRound(keypoint.pt.x / scale), cvRound(keypoint.pt.y / scale)};
}

}  // namespace

// ORB drops points near the border; its default of 31 px leaves small images without upper pyramid levels
// (loop-closure.md section 6). A twentieth of the shorter side keeps them; ORB reflects the image at its
// border. Half of OpenCV's FAST threshold, so that dark images have their share of points, too.
OrbOptions OrbOptionsFor(cv::Size size, int features) {
  constexpr double kBorder = 0.05;  // of the shorter side
  constexpr int kFastThreshold = 10;
  OrbOptions out;
  const int side = std::min(size.width, size.height);
  out.features = features;
  out.edge = std::clamp(static_cast<int>(kBorder * side), 3, 31);
  out.fast_threshold = kFastThreshold;
  for (double s = side / kScale; out.levels < kMostLevels && s > 2 * out.edge + kPatch; s /= kScale) {
    ++out.levels;
  }
  return out;
}

Orb::Orb(const cv::Mat& image, const OrbOptions& options) : options_(options) {
  const std::vector<int> wanted = PointsPerLevel(options.features, options.levels);
  for (int l = 0; l < options.levels; ++l) {
    Level level;
    level.scale = ScaleOf(l);
    level.wanted = wanted[Index(l)];
    cv::Mat resized = image;
    if (l > 0) {
      const float inverse = 1.0f / level.scale;
      const cv::Size size(cvRound(static_cast<float>(image.cols) * inverse),
                          cvRound(static_cast<float>(image.rows) * inverse));
      cv::resize(levels_.back().image, resized, size, 0, 0, cv::INTER_LINEAR_EXACT);
    }
    cv::copyMakeBorder(resized, level.padded, kPadding, kPadding, kPadding, kPadding, cv::BORDER_REFLECT_101);
    level.image = level.padded(cv::Rect({kPadding, kPadding}, resized.size()));
    levels_.push_back(level);
  }
}

std::vector<cv::KeyPoint> Orb::DetectOn(const Level& level) const {
  constexpr int kCircle = 3;  // FAST's [px]
  const cv::Rect kept(options_.edge, options_.edge, level.image.cols - 2 * options_.edge,
                      level.image.rows - 2 * options_.edge);
  if (kept.width <= 0 || kept.height <= 0) return {};
  // Those next to a kept one count, for it has to be the strongest.
  const int rim = std::max(0, options_.edge - kCircle - 1);
  const cv::Rect seen(rim, rim, level.image.cols - 2 * rim, level.image.rows - 2 * rim);
  std::vector<cv::KeyPoint> corners = FastCorners(level.image(seen), options_.fast_threshold);
  for (cv::KeyPoint& corner : corners)
    corner.pt += cv::Point2f(static_cast<float>(rim), static_cast<float>(rim));
  corners.erase(std::remove_if(corners.begin(), corners.end(),
                               [&kept](const cv::KeyPoint& corner) { return !kept.contains(corner.pt); }),
                corners.end());
  cv::KeyPointsFilter::retainBest(corners, 2 * level.wanted);
  for (cv::KeyPoint& corner : corners) {
    corner.response = HarrisResponse(level.padded, static_cast<int>(corner.pt.x) + kPadding,
                                     static_cast<int>(corner.pt.y) + kPadding);
  }
  cv::KeyPointsFilter::retainBest(corners, level.wanted);
  return corners;
}

std::vector<cv::KeyPoint> Orb::Detect() const {
  std::vector<cv::KeyPoint> keypoints;
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    for (cv::KeyPoint& corner : DetectOn(levels_[l])) {
      corner.octave = static_cast<int>(l);
      corner.size = kPatch * levels_[l].scale;
      corner.pt *= levels_[l].scale;
      keypoints.push_back(corner);
    }
  }
  return keypoints;
}

cv::Mat Orb::Describe(std::vector<cv::KeyPoint>& keypoints) const {
  static_assert(kPadding >= OrbDescription::kMargin);
  cv::Mat descriptors;
  if (keypoints.empty()) return descriptors;
  descriptors.create(static_cast<int>(keypoints.size()), OrbDescription::kBytes, CV_8UC1);
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    const Level& level = levels_[l];
    std::optional<OrbDescription> description;  // costs nothing on a level without points
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      if (keypoints[i].octave != static_cast<int>(l)) continue;
      if (!description) description.emplace(level.padded, kPadding);
      const cv::Point at = PixelOf(keypoints[i], level.scale) + cv::Point(kPadding, kPadding);
      keypoints[i].angle = OrbPatch().Angle(level.padded, at.x, at.y);
      description->Describe(at.x, at.y, keypoints[i].angle, descriptors.ptr(static_cast<int>(i)));
    }
  }
  return descriptors;
}

}  // namespace tutti::internal
