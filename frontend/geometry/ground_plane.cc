#include "frontend/geometry/ground_plane.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/dense_solvers.h"
#include "core/numbers.h"

namespace tutti {
namespace {

constexpr double kNearest = 3, kFarthest = 8;  // of the ground that is looked at [heights]
constexpr int kFromEdge = 4;                   // of the image [px]
constexpr double kMostPixels = 2500, kMostInSearch = 600, kFewestPixels = 150;
constexpr int kIterations = 10;
constexpr double kConverged = 1e-3, kNearlyConverged = 1e-2;  // of the plane
constexpr double kHuber = 1.5, kLeastSpread = 0.5;            // [standard deviations], [grey levels]
constexpr double kLowest = 0.05, kHighest = 20;               // that is searched [ways between the images]
constexpr int kHeights = 121;
constexpr double kSteepest = 0.71;  // of the way against the camera's x-z plane [sine]

struct Pixel {
  Eigen::Vector3d ray;  // z = 1
  double grey = 0;
};

// What the plane n . X = h says is between kNearest and kFarthest ahead, and kGroundAside to each side
// [heights]: four half planes of rays r with n . r > 0, each with a . r > 0. Ahead is where the camera looks.
using Field = Eigen::Matrix<double, 5, 3>;

Field LookedAt(const Eigen::Vector3d& plane) {
  const Eigen::Vector3d normal = plane.normalized();
  const Eigen::Vector3d ahead = AheadOnGround(normal);
  const Eigen::Vector3d aside = normal.cross(ahead);
  Field field;
  field.row(0) = normal;
  field.row(1) = ahead - kNearest * normal;
  field.row(2) = kFarthest * normal - ahead;
  field.row(3) = kGroundAside * normal - aside;
  field.row(4) = kGroundAside * normal + aside;
  return field;
}

// The part of a row of the image that is in the field: columns from..to, the last one, too.
struct RowPart {
  int row = 0, from = 0, to = -1;
};

RowPart PartOf(const PinholeCamera& camera, const cv::Mat& image, const Field& field, int row) {
  const double y = (row - camera.cy) / camera.fy;
  double from = 1, to = image.cols - 2;
  for (int i = 0; i < field.rows(); ++i) {
    const double slope = field(i, 0) / camera.fx;
    const double at_cx = field(i, 1) * y + field(i, 2);  // positive: the column cx is in
    if (std::abs(slope) < 1e-12) {
      if (!(at_cx > 0)) to = -1;
      continue;
    }
    const double edge = camera.cx - at_cx / slope;
    if (slope > 0)
      from = std::max(from, edge);
    else
      to = std::min(to, edge);
  }
  if (!(to >= from)) return {};
  return {row, static_cast<int>(std::ceil(from)), static_cast<int>(std::floor(to))};
}

// Takes at most so many pixels, on a regular grid, of what the plane says is ground.
std::vector<Pixel> GroundPixels(const PinholeCamera& camera, const cv::Mat& image,
                                const Eigen::Vector3d& plane, double most) {
  const Field field = LookedAt(plane);
  std::vector<RowPart> parts;
  double area = 0;
  for (int v = kFromEdge; v < image.rows - kFromEdge; ++v) {
    const RowPart part = PartOf(camera, image, field, v);
    if (part.to <= part.from) continue;
    area += part.to - part.from;
    parts.push_back(part);
  }
  std::vector<Pixel> pixels;
  if (area < kFewestPixels) return pixels;
  const int stride = std::max(1, static_cast<int>(std::ceil(std::sqrt(area / most))));
  for (const RowPart& part : parts) {
    if (part.row % stride != 0) continue;
    const unsigned char* const greys = image.ptr<unsigned char>(part.row);
    for (int u = part.from; u < part.to; u += stride)
      pixels.push_back(
          {{(u - camera.cx) / camera.fx, (part.row - camera.cy) / camera.fy, 1}, double(greys[u])});
  }
  return pixels;
}

struct Sample {
  double grey = 0;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();  // [grey levels per px]
};

// Between four pixels. False: outside.
bool SampleAt(const cv::Mat& image, double u, double v, Sample* sample) {
  if (!(u >= 2) || !(v >= 2) || !(u < image.cols - 3) || !(v < image.rows - 3)) return false;
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const double fx = u - x, fy = v - y;
  const unsigned char *const above = image.ptr<unsigned char>(y) + x, *const below =
                                                                          image.ptr<unsigned char>(y + 1) + x;
  const double a = above[0], b = above[1], c = below[0], d = below[1];
  sample->grey = (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy;
  sample->slope = {(b - a) * (1 - fy) + (d - c) * fy, (c - a) * (1 - fx) + (d - b) * fx};
  return true;
}

// What of the first image is found in the second one by a plane.
struct Pairs {
  std::vector<double> first, second;      // grey values
  std::vector<Eigen::Vector3d> by_plane;  // derivative of the second
};

void Find(const PinholeCamera& camera, const std::vector<Pixel>& pixels, const cv::Mat& second,
          const Pose& T_second_first, const Eigen::Vector3d& plane, Pairs* pairs) {
  pairs->first.clear();
  pairs->second.clear();
  pairs->by_plane.clear();
  const Eigen::Matrix3d R = T_second_first.rotation.toRotationMatrix();
  const Eigen::Vector3d& t = T_second_first.translation;
  for (const Pixel& p : pixels) {
    const Eigen::Vector3d X = R * p.ray + plane.dot(p.ray) * t;  // over the depth in the first image
    if (!(X.z() > 0.05)) continue;
    const double z = 1 / X.z(), x = X.x() * z, y = X.y() * z;
    Sample sample;
    if (!SampleAt(second, camera.fx * x + camera.cx, camera.fy * y + camera.cy, &sample)) continue;
    const double along = sample.slope.x() * camera.fx * (t.x() - x * t.z()) * z +
                         sample.slope.y() * camera.fy * (t.y() - y * t.z()) * z;
    pairs->first.push_back(p.grey);
    pairs->second.push_back(sample.grey);
    pairs->by_plane.push_back(along * p.ray);
  }
}

struct Brightness {
  double gain = 1, offset = 0, correlation = 0;
};

// first = gain second + offset, by least squares.
Brightness Compare(const Pairs& pairs) {
  const double n = static_cast<double>(pairs.first.size());
  double a = 0, b = 0, aa = 0, ab = 0, bb = 0;
  for (std::size_t i = 0; i < pairs.first.size(); ++i) {
    a += pairs.first[i];
    b += pairs.second[i];
    aa += pairs.first[i] * pairs.first[i];
    ab += pairs.first[i] * pairs.second[i];
    bb += pairs.second[i] * pairs.second[i];
  }
  const double va = aa - a * a / n, vb = bb - b * b / n, cov = ab - a * b / n;
  Brightness out;
  if (!(va > n) || !(vb > n)) return out;  // less than a grey level of contrast
  out.gain = cov / vb;
  out.offset = (a - out.gain * b) / n;
  out.correlation = cov / std::sqrt(va * vb);
  return out;
}

}  // namespace

Eigen::Vector3d AheadOnGround(const Eigen::Vector3d& normal) {
  return (Eigen::Vector3d::UnitZ() - normal.z() * normal).stableNormalized();
}

std::optional<GroundPlane> AlignGround(const PinholeCamera& camera, const cv::Mat& first,
                                       const cv::Mat& second, const Pose& T_second_first,
                                       const Eigen::Vector3d& start) {
  const std::vector<Pixel> pixels = GroundPixels(camera, first, start, kMostPixels);
  Eigen::Vector3d plane = start;
  Pairs pairs;
  std::vector<double> sizes;
  double last_step = INFINITY;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Find(camera, pixels, second, T_second_first, plane, &pairs);
    if (static_cast<double>(pairs.first.size()) < kFewestPixels) return std::nullopt;
    const Brightness brightness = Compare(pairs);
    sizes.clear();
    for (std::size_t i = 0; i < pairs.first.size(); ++i)
      sizes.push_back(std::abs(brightness.gain * pairs.second[i] + brightness.offset - pairs.first[i]));
    const double spread = 1.4826 * internal::Median(sizes) + kLeastSpread;
    Eigen::Matrix<double, 5, 5> hessian = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> gradient = Eigen::Matrix<double, 5, 1>::Zero(), step;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      const double residual = brightness.gain * pairs.second[i] + brightness.offset - pairs.first[i];
      const double weight = 1 / std::max(1.0, sizes[i] / (kHuber * spread));
      Eigen::Matrix<double, 5, 1> j;
      j << brightness.gain * pairs.by_plane[i], pairs.second[i] / 100, 1;
      hessian.selfadjointView<Eigen::Lower>().rankUpdate(j, weight);
      gradient += weight * residual * j;
    }
    hessian = Eigen::Matrix<double, 5, 5>(hessian.selfadjointView<Eigen::Lower>());
    internal::SolveLdlt(5, hessian.data(), gradient.data(), step.data());
    if (!step.allFinite()) return std::nullopt;
    plane -= step.head<3>();
    if (!(plane.norm() > 0)) return std::nullopt;
    last_step = step.head<3>().norm() / plane.norm();
    if (last_step < kConverged) break;
  }
  if (!(last_step < kNearlyConverged)) return std::nullopt;
  Find(camera, pixels, second, T_second_first, plane, &pairs);
  if (static_cast<double>(pairs.first.size()) < kFewestPixels) return std::nullopt;
  const double correlation = Compare(pairs).correlation;
  if (!(correlation > 0)) return std::nullopt;
  return GroundPlane{plane, correlation};
}

std::optional<Eigen::Vector3d> NormalBelow(const Pose& T_second_first) {
  const Eigen::Vector3d way = T_second_first.rotation.conjugate() * T_second_first.translation;
  if (!(way.norm() > 0)) return std::nullopt;
  const Eigen::Vector3d along = way.normalized(), y = Eigen::Vector3d::UnitY();
  if (!(std::abs(along.y()) < kSteepest)) return std::nullopt;
  return (y - along.y() * along).normalized();
}

std::optional<GroundPlane> SearchGround(const PinholeCamera& camera, const cv::Mat& first,
                                        const cv::Mat& second, const Pose& T_second_first) {
  const double way = T_second_first.translation.norm();
  std::optional<GroundPlane> best;
  const std::optional<Eigen::Vector3d> normal = NormalBelow(T_second_first);
  Pairs pairs;
  for (int i = 0; normal && i < kHeights; ++i) {
    const double height = way * kLowest * std::pow(kHighest / kLowest, i / (kHeights - 1.0));
    const Eigen::Vector3d plane = *normal / height;
    Find(camera, GroundPixels(camera, first, plane, kMostInSearch), second, T_second_first, plane, &pairs);
    if (static_cast<double>(pairs.first.size()) < kFewestPixels) continue;
    const double correlation = Compare(pairs).correlation;
    if (!best || correlation > best->correlation) best = GroundPlane{plane, correlation};
  }
  return best;
}

}  // namespace tutti
