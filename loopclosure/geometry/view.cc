#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <vector>

#include "core/numbers.h"
#include "core/state_archive.h"
#include "loopclosure/geometry/verification.h"

namespace tutti {
namespace {

// What MakeView gives a feature without a point; all others are saved.
Eigen::Vector3f UnknownPoint() { return Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()); }
bool IsUnknown(const Eigen::Vector3f& point) {
  const Eigen::Vector3f unknown = UnknownPoint();
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): these bits of all that are no number
  return std::memcmp(point.data(), unknown.data(), sizeof(float) * 3) == 0;
}

// Depth at a pixel: median of the valid among 3x3; 0 where it is unknown or the pixels disagree.
float DepthAt(const cv::Mat& depth_m, const cv::Point2f& pixel, const VerificationOptions& options) {
  constexpr float kMaxDisagreement = 0.05f;
  const int x = static_cast<int>(std::lround(pixel.x));
  const int y = static_cast<int>(std::lround(pixel.y));
  std::array<float, 9> values{};
  std::size_t count = 0;
  for (int r = std::max(0, y - 1); r <= std::min(depth_m.rows - 1, y + 1); ++r) {
    for (int c = std::max(0, x - 1); c <= std::min(depth_m.cols - 1, x + 1); ++c) {
      const float z = depth_m.at<float>(r, c);
      if (std::isfinite(z) && z > options.min_depth_m && z < options.max_depth_m) values[count++] = z;
    }
  }
  if (count < 5) return 0.0f;
  std::sort(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(count));
  if (values[count - 1] - values[0] > kMaxDisagreement * values[0]) return 0.0f;
  return values[count / 2];
}

View::Set MakeSet(const std::vector<cv::KeyPoint>& keypoints, const cv::Mat& descriptors) {
  View::Set set;
  if (keypoints.empty()) return set;  // a dense member's descriptor is of no pixel
  set.pixels.reserve(keypoints.size());
  for (const cv::KeyPoint& keypoint : keypoints) set.pixels.push_back(keypoint.pt);
  set.descriptors = descriptors;
  return set;
}

void LookUpDepth(const LoopQuery& query, const VerificationOptions& options, View::Set& set) {
  if (query.depth_m.empty() || query.depth_m.type() != CV_32FC1 || !query.camera) return;
  if (set.points.empty()) set.points.assign(set.pixels.size(), UnknownPoint());
  for (std::size_t i = 0; i < set.pixels.size(); ++i) {
    if (set.points[i].allFinite()) continue;
    const float z = DepthAt(query.depth_m, set.pixels[i], options);
    if (z <= 0.0f) continue;
    const Eigen::Vector3d ray = query.camera->Unproject({set.pixels[i].x, set.pixels[i].y});
    set.points[i] = ray.cast<float>() * z;
  }
}

// The caller counts his features whatever is dropped: their numbers stay with them.
void DropMasked(const cv::Mat& mask, View::Set& set) {
  if (mask.empty()) return;
  View::Set kept;
  const cv::Mat all = set.descriptors.Unpacked();
  cv::Mat descriptors;
  for (std::size_t i = 0; i < set.pixels.size(); ++i) {
    if (IsMasked(mask, set.pixels[i])) continue;
    kept.pixels.push_back(set.pixels[i]);
    descriptors.push_back(all.row(static_cast<int>(i)));
    if (!set.points.empty()) kept.points.push_back(set.points[i]);
    kept.numbers.push_back(static_cast<int>(i));
  }
  if (kept.pixels.size() == set.pixels.size()) return;
  kept.descriptors = descriptors;
  set = std::move(kept);
}

// Size of the image; without one (the caller extracts all features) of the camera, or what the features reach
// over.
cv::Size SizeOf(const LoopQuery& query, const std::vector<Features>& members) {
  if (!query.image.empty()) return query.image.size();
  if (query.camera) return {query.camera->width, query.camera->height};
  cv::Point2f most(0, 0);
  for (const Features& features : members) {
    for (const cv::KeyPoint& keypoint : features.keypoints) {
      most.x = std::max(most.x, keypoint.pt.x);
      most.y = std::max(most.y, keypoint.pt.y);
    }
  }
  return {static_cast<int>(std::ceil(most.x)) + 1, static_cast<int>(std::ceil(most.y)) + 1};
}

}  // namespace

View MakeView(const LoopQuery& query, const std::vector<Features>& members,
              const VerificationOptions& options) {
  View view;
  view.id = query.id;
  view.size = SizeOf(query, members);
  view.camera = query.camera;
  view.metric = query.metric;
  view.cameras = query.cameras;
  for (const Features& features : members) {
    view.members.push_back(MakeSet(features.keypoints, features.descriptors));
    if (query.metric) LookUpDepth(query, options, view.members.back());
  }
  // The caller owns its matrix and may write into it later: keep a copy.
  view.caller = MakeSet(query.features.keypoints, query.features.descriptors.clone());
  for (const Eigen::Vector3d& point : query.features.points)
    view.caller.points.push_back(point.cast<float>());
  DropMasked(query.mask, view.caller);
  if (query.metric) LookUpDepth(query, options, view.caller);
  return view;
}

namespace {

// No points, or one for each of `features`: whether it is known, a bit each, and those that are.
template <class Archive>
void StateOfPoints(Archive& archive, std::size_t features, std::vector<Eigen::Vector3f>& points) {
  std::vector<std::uint8_t> is_known((points.size() + 7) / 8, 0);
  std::vector<float> known;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (IsUnknown(points[i])) continue;
    is_known[i / 8] = static_cast<std::uint8_t>(is_known[i / 8] | 1U << i % 8);
    known.insert(known.end(), points[i].begin(), points[i].end());
  }
  std::uint64_t count = points.size();
  archive(count, is_known, internal::Planes{&known});
  if constexpr (Archive::kReading) {
    if ((count != 0 && count != features) || is_known.size() != (count + 7) / 8)
      archive.Damaged("features without points");
    points.assign(count, UnknownPoint());
    auto next = known.begin();
    for (std::size_t i = 0; i < count; ++i) {
      if ((is_known[i / 8] & 1U << i % 8) == 0) continue;
      if (known.end() - next < 3) archive.Damaged("features without points");
      points[i] = {next[0], next[1], next[2]};
      next += 3;
    }
    if (next != known.end()) archive.Damaged("points without features");
  }
}

template <class Archive>
void StateOfCamera(Archive& archive, std::optional<PinholeCamera>& camera) {
  bool is_there = camera.has_value();
  archive(is_there);
  if (!is_there) return;
  if constexpr (Archive::kReading) camera.emplace();
  PinholeCamera& c = *camera;
  archive(c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.distortion, c.coefficients);
  if constexpr (Archive::kReading) {
    archive.Check(static_cast<int>(c.distortion), 0, static_cast<int>(Distortion::kEquidistant) + 1,
                  "an unknown lens distortion");
    if (!c.Validate().empty()) archive.Damaged("a camera that is not usable");
  }
}

template <class Archive>
void StateOfRegions(Archive& archive, std::vector<cv::Rect>& regions) {
  std::vector<int> sides;
  for (const cv::Rect& r : regions) sides.insert(sides.end(), {r.x, r.y, r.width, r.height});
  archive(sides);
  if constexpr (Archive::kReading) {
    if (sides.size() % 4 != 0) archive.Damaged("a camera's part of an image without a side");
    for (std::size_t i = 0; i < sides.size(); i += 4) {
      regions.emplace_back(sides[i], sides[i + 1], sides[i + 2], sides[i + 3]);
      const cv::Rect& r = regions.back();
      const auto beyond = [](int side) { return static_cast<float>(side) > View::kFarthestPixel; };
      if (r.x < 0 || r.y < 0 || r.width < 1 || r.height < 1 || beyond(r.x) || beyond(r.y) ||
          beyond(r.width) || beyond(r.height)) {
        archive.Damaged("a camera's part of an image at an impossible place");
      }
    }
  }
}

}  // namespace

// Pixels as those of keypoints in a saved odometry (StateOfKeypoints), so that zstd finds the same bytes.
template <class Archive>
void View::Set::State(Archive& archive) {
  std::vector<float> x, y;
  for (const cv::Point2f& pixel : pixels) {
    x.push_back(pixel.x);
    y.push_back(pixel.y);
  }
  archive(internal::Planes{&x}, internal::Planes{&y}, descriptors);
  if constexpr (Archive::kReading) {
    const auto is_pixel = [](float value) { return std::abs(value) <= kFarthestPixel; };  // false for NaN
    if (x.size() != y.size() || !std::all_of(x.begin(), x.end(), is_pixel) ||
        !std::all_of(y.begin(), y.end(), is_pixel)) {
      archive.Damaged("a feature at an impossible pixel");
    }
    for (std::size_t i = 0; i < x.size(); ++i) pixels.emplace_back(x[i], y[i]);
    if (internal::Index(descriptors.rows()) != pixels.size()) archive.Damaged("features without descriptors");
  }
  StateOfPoints(archive, pixels.size(), points);
}

template <class Archive>
void View::State(Archive& archive) {
  archive(id, size.width, size.height, metric);
  StateOfCamera(archive, camera);
  StateOfRegions(archive, cameras);
  archive(caller);  // before the members: next to what it may be like (SectionWriter)
  archive(members, caller.numbers);
  if constexpr (Archive::kReading) {
    if (size.width < 1 || size.height < 1) archive.Damaged("an image of an impossible size");
    const std::vector<int>& numbers = caller.numbers;
    if (!numbers.empty() && (numbers.size() != caller.pixels.size() ||
                             std::any_of(numbers.begin(), numbers.end(), [](int n) { return n < 0; })))
      archive.Damaged("features without numbers");
  }
}

template void View::State(internal::StateWriter& archive);
template void View::State(internal::StateReader& archive);

}  // namespace tutti
