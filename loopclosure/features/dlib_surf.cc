// dlib's matrices scale through BLAS where dlib was configured with it. Here that is one vector of 64
// numbers: our own function takes its place, so that tutti needs neither BLAS nor libdlib at link time.
#define cblas_dscal tutti_cblas_dscal
#include <dlib/image_keypoint/surf.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "core/numbers.h"
#include "loopclosure/features/scratch_pool.h"
#include "loopclosure/features/surf_hessian.h"
#include "loopclosure/store/packed_mat.h"
#include "tutti/loopclosure/features.h"

extern "C" void tutti_cblas_dscal(const CBLAS_INT_TYPE n, const double alpha, double* x,
                                  const CBLAS_INT_TYPE step);
extern "C" void tutti_cblas_dscal(const CBLAS_INT_TYPE n, const double alpha, double* x,
                                  const CBLAS_INT_TYPE step) {
  for (CBLAS_INT_TYPE i = 0; i < n; ++i) x[i * step] *= alpha;
}

namespace tutti {
namespace {

constexpr int kDescriptorSize = 64;
constexpr double kBorder = 32.0;  // dlib describes a point from a window of this many scales
constexpr float kSizePerScale =
    20.0f;  // SURF describes a patch of 20 scales: the diameter that cv::KeyPoint wants

using Integral = internal::SurfIntegral;

// Gaussian of dlib::compute_dominant_angle by squared distance from the centre [samples].
const std::array<double, 36>& AngleWeights() {
  static const std::array<double, 36> weights = [] {
    std::array<double, 36> values{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = dlib::gaussian(std::sqrt(static_cast<double>(i)), 0.0, 2.5);
    }
    return values;
  }();
  return weights;
}

constexpr int kSlices = 45;  // of the circle; each is a sixth of it, so that they overlap
constexpr double kStep = 2 * CV_PI / kSlices;
constexpr double kWidth = CV_PI / 3;
using SliceSums = std::array<dlib::vector<double, 2>, kSlices>;

// Rounded, as dlib does it; of coordinates inside of an image.
dlib::point Nearest(const dlib::vector<double, 2>& p) {
  // NOLINTNEXTLINE(bugprone-incorrect-roundings): other bits at halves
  return {static_cast<long>(p.x() + 0.5), static_cast<long>(p.y() + 0.5)};
}

// atan2 to 1e-5 (Abramowitz & Stegun 4.4.49 with terms of a smaller error); (x, y) is not 0.
double RoughAngle(double y, double x) {
  const double across = std::abs(x);
  const double along = std::abs(y);
  const double a = std::min(across, along) / std::max(across, along);
  const double s = a * a;
  double angle =
      a * (0.99997726 +
           s * (-0.33262347 + s * (0.19354346 + s * (-0.11643287 + s * (0.05265332 - s * 0.01172120)))));
  if (along > across) angle = CV_PI / 2 - angle;
  if (x < 0) angle = CV_PI - angle;
  return y < 0 ? -angle : angle;
}

// Adds a sample to the slices that hold its angle, as dlib::compute_dominant_angle asks for them: of the
// overlapping ones a fifth can.
void AddByAngle(const dlib::vector<double, 2>& sample, SliceSums& sums) {
  constexpr double kPi = CV_PI;
  constexpr int kReach = 9;  // slices back from the newest that can hold an angle: kWidth / kStep, rounded up
  const double angle = std::atan2(sample.y(), sample.x());
  const int newest = static_cast<int>((angle + kPi) / kStep) + 1;
  for (int s = newest - kReach; s <= newest; ++s) {
    const int slice = (s + kSlices) % kSlices;
    const double begin = kStep * slice - kPi;
    const double end = begin + kWidth;
    const bool inside = begin <= angle && angle <= end;
    if (inside || (end > kPi && (angle >= begin || angle <= -2 * kPi + end))) {
      sums[internal::Index(slice)] += sample;
    }
  }
}

// Does what AddByAngle does. Slices begin and end at whole sectors, two to a step: only a sample next to a
// sector's border needs its angle exactly.
void AddBySector(const dlib::vector<double, 2>& sample, SliceSums& sums) {
  constexpr int kSectors = 2 * kSlices;
  constexpr int kSectorsOfSlice = 15;
  constexpr double kMargin = 0.01;  // of a sector, 70 times the error of the angle
  static_assert(kSectorsOfSlice * 6 == kSectors);
  if (sample.x() == 0 && sample.y() == 0) return;
  const double place = (RoughAngle(sample.y(), sample.x()) + CV_PI) * (kSectors / (2 * CV_PI));
  const int sector = static_cast<int>(place);
  const double within = place - sector;
  if (within < kMargin || within > 1 - kMargin) {
    AddByAngle(sample, sums);
    return;
  }
  const int last = sector / 2;
  for (int s = last - (kSectorsOfSlice - 1) / 2 + sector % 2; s <= last; ++s) {
    sums[internal::Index(s < 0 ? s + kSlices : s)] += sample;
  }
}

// Equals dlib::compute_dominant_angle, sum for sum.
double DominantAngle(const Integral& image, const dlib::vector<double, 2>& centre, double scale) {
  constexpr int kRadius = 6;
  SliceSums sums;
  const long sc = std::lround(scale);
  for (long r = -kRadius; r <= kRadius; ++r) {
    for (long c = -kRadius; c <= kRadius; ++c) {
      if (r * r + c * c >= kRadius * kRadius) continue;
      const double weight = AngleWeights()[static_cast<std::size_t>(r * r + c * c)];
      const auto [x, y] = image.Haar(Nearest(sc * dlib::point(c, r) + centre), 4 * sc);
      AddBySector(dlib::vector<double, 2>(weight * x, weight * y), sums);
    }
  }
  double longest = 0.0;
  dlib::vector<double, 2> best(1.0, 0.0);
  for (const dlib::vector<double, 2>& sum : sums) {
    if (sum.length_squared() <= longest) continue;
    longest = sum.length_squared();
    best = sum;
  }
  return std::atan2(best.y(), best.x());
}

// Equals dlib::compute_surf_descriptor, sum for sum; but its 4 x 4 cells overlap, and each of the 20 x 20
// samples is taken from the image and turned once. Values are rounded such that they fit a byte, as SIFT's
// do: a saved map is a fifth smaller.
void SurfDescriptor(const Integral& image, const dlib::vector<double, 2>& centre, double scale, double angle,
                    float* descriptor) {
  constexpr int kSide = 20, kHalf = kSide / 2;
  constexpr int kCell = 5;
  constexpr std::array<double, 7> kWeights = {1.0 / 4, 1.0 / 5, 1.0 / 6, 1.0 / 7, 1.0 / 8, 1.0 / 9, 1.0 / 10};
  const dlib::point_rotator rotate(angle);
  const dlib::point_rotator rotate_back(-angle);
  const long sc = std::lround(scale);
  std::array<std::array<dlib::vector<double, 2>, kSide>, kSide> samples;  // [y][x]
  for (std::size_t y = 0; y < kSide; ++y) {
    for (std::size_t x = 0; x < kSide; ++x) {
      const dlib::vector<double, 2> offset(scale * (static_cast<double>(x) - kHalf),
                                           scale * (static_cast<double>(y) - kHalf));
      const auto [dx, dy] = image.Haar(Nearest(rotate(offset) + centre), 2 * sc);
      samples[y][x] = rotate_back(dlib::vector<double, 2>(dx, dy));
    }
  }
  std::array<double, kDescriptorSize> values{};
  double* value = values.data();
  for (int r = 0; r < kSide; r += kCell) {
    for (int c = 0; c < kSide; c += kCell) {
      for (int y = std::max(0, r - 1); y < std::min(kSide, r + kCell + 1); ++y) {
        for (int x = std::max(0, c - 1); x < std::min(kSide, c + kCell + 1); ++x) {
          const int away = std::abs(r + 2 - y) + std::abs(c + 2 - x);
          const double weight = kWeights[internal::Index(away)];
          const dlib::vector<double, 2>& sample = samples[internal::Index(y)][internal::Index(x)];
          const double dx = weight * sample.x();
          const double dy = weight * sample.y();
          value[0] += dx;
          value[1] += dy;
          value[2] += std::abs(dx);
          value[3] += std::abs(dy);
        }
      }
      value += 4;
    }
  }
  double squares = 0.0;
  for (const double v : values) squares += v * v;
  const double length = std::sqrt(squares) + 1e-7;
  for (std::size_t i = 0; i < values.size(); ++i) {
    descriptor[i] = internal::SignedSquare(internal::SignedRoot(static_cast<float>(values[i] / length)));
  }
}

// Where the determinant of the Hessian has a maximum among its neighbours in place and scale.
class HessianMaxima {
 public:
  explicit HessianMaxima(const internal::SurfHessian& hessian) : hessian_(hessian) {}

  // Equals dlib::get_interest_points.
  std::vector<dlib::interest_point> Points(double threshold) const {
    std::vector<dlib::interest_point> points;
    for (int o = 0; o < hessian_.octaves(); ++o) {
      for (int i = 1; i < Hessian::kIntervals - 1; ++i) {
        const cv::Mat& layer = Layer(o, i);
        const int margin = Hessian::Border(i + 1) + 1;
        std::vector<std::uint8_t> found(internal::Index(layer.cols));
        for (int r = margin; r < layer.rows - margin; ++r) {
          internal::FindMaxima(layer.ptr<double>(r), layer.ptr<double>(r - 1), layer.ptr<double>(r + 1),
                               Layer(o, i - 1).ptr<double>(r), Layer(o, i + 1).ptr<double>(r), margin,
                               layer.cols - margin, threshold, found.data());
          for (int c = margin; c < layer.cols - margin; ++c) {
            dlib::interest_point point;
            if (found[internal::Index(c)] != 0 && IsMaximum(o, i, r, c) && Interpolate(o, i, r, c, point)) {
              points.push_back(point);
            }
          }
        }
      }
    }
    return points;
  }

 private:
  using Hessian = internal::SurfHessian;

  const cv::Mat& Layer(int octave, int interval) const { return hessian_.Layer(octave, interval); }
  double Value(int octave, int interval, int r, int c) const {
    return std::abs(Layer(octave, interval).at<double>(r, c));
  }

  bool IsMaximum(int octave, int interval, int row, int col) const {
    const double value = Value(octave, interval, row, col);
    for (int i = interval - 1; i <= interval + 1; ++i) {
      for (int r = row - 1; r <= row + 1; ++r) {
        const double* line = Layer(octave, i).ptr<double>(r) + col;
        if (std::abs(line[-1]) > value || std::abs(line[0]) > value || std::abs(line[1]) > value)
          return false;
      }
    }
    return true;
  }

  // False if the maximum of the parabola through its neighbours is nearer to one of them.
  bool Interpolate(int o, int i, int r, int c, dlib::interest_point& point) const {
    const auto at = [&](int di, int dr, int dc) { return Value(o, i + di, r + dr, c + dc); };
    const double value = at(0, 0, 0);
    const cv::Vec3d slope((at(0, 0, 1) - at(0, 0, -1)) / 2, (at(0, 1, 0) - at(0, -1, 0)) / 2,
                          (at(1, 0, 0) - at(-1, 0, 0)) / 2);
    const double xx = at(0, 0, 1) + at(0, 0, -1) - 2 * value;
    const double yy = at(0, 1, 0) + at(0, -1, 0) - 2 * value;
    const double ss = at(1, 0, 0) + at(-1, 0, 0) - 2 * value;
    const double xy = (at(0, 1, 1) + at(0, -1, -1) - at(0, -1, 1) - at(0, 1, -1)) / 4;
    const double xs = (at(1, 0, 1) + at(-1, 0, -1) - at(-1, 0, 1) - at(1, 0, -1)) / 4;
    const double ys = (at(1, 1, 0) + at(-1, -1, 0) - at(-1, 1, 0) - at(1, -1, 0)) / 4;
    const cv::Matx33d curvature(xx, xy, xs, xy, yy, ys, xs, ys, ss);
    if (cv::determinant(curvature) == 0) return false;
    const cv::Vec3d offset = -(curvature.inv() * slope);
    if (!(std::abs(offset[0]) < 0.5 && std::abs(offset[1]) < 0.5 && std::abs(offset[2]) < 0.5)) return false;
    const double lobe = static_cast<double>(2 << o) * (i + offset[2] + 1) + 1;
    point.center =
        dlib::vector<double, 2>(c + offset[0], r + offset[1]) * static_cast<double>(Hessian::Step(o));
    point.scale = 1.2 / 9.0 * 3 * lobe;
    point.score = value;
    point.laplacian = Layer(o, i).at<double>(r, c) > 0 ? 1 : -1;
    return true;
  }

  const Hessian& hessian_;
};

class DlibSurf : public cv::Feature2D {
 public:
  DlibSurf(int max_features, int octaves, double threshold)
      : max_features_(max_features), octaves_(octaves), threshold_(threshold) {}

  void detectAndCompute(cv::InputArray image, cv::InputArray mask, std::vector<cv::KeyPoint>& keypoints,
                        cv::OutputArray descriptors, bool use_provided) override {
    const cv::Mat grey = image.getMat();
    CV_Assert(grey.type() == CV_8UC1);
    std::unique_ptr<Scratch> scratch = scratches_.Take();
    scratch->integral.Compute(grey);
    if (!use_provided) Detect(*scratch, mask.getMat(), keypoints);
    if (descriptors.needed()) Describe(scratch->integral, keypoints, descriptors);
    scratches_.Give(std::move(scratch));
  }

  int descriptorSize() const override { return kDescriptorSize; }
  int descriptorType() const override { return CV_32F; }
  int defaultNorm() const override { return cv::NORM_L2; }
  cv::String getDefaultName() const override { return "tutti.DlibSurf"; }

 private:
  struct Scratch {
    Integral integral;
    internal::SurfHessian hessian;
  };

  static bool Describable(const Integral& integral, const dlib::vector<double, 2>& centre, double scale) {
    const unsigned long border = static_cast<unsigned long>(kBorder * scale);
    const dlib::rectangle image(0, 0, integral.nc() - 1, integral.nr() - 1);
    return image.contains(dlib::centered_rect(dlib::point(centre), border, border));
  }

  void Detect(Scratch& scratch, const cv::Mat& mask, std::vector<cv::KeyPoint>& keypoints) const {
    scratch.hessian.Compute(scratch.integral, octaves_);
    std::vector<dlib::interest_point> points = HessianMaxima(scratch.hessian).Points(threshold_);
    std::stable_sort(points.begin(), points.end(),
                     [](const auto& a, const auto& b) { return a.score > b.score; });
    keypoints.clear();
    for (const dlib::interest_point& point : points) {
      if (static_cast<int>(keypoints.size()) >= max_features_) break;
      if (!Describable(scratch.integral, point.center, point.scale)) continue;
      const float x = static_cast<float>(point.center.x());
      const float y = static_cast<float>(point.center.y());
      if (!mask.empty() && mask.at<std::uint8_t>(cvRound(y), cvRound(x)) == 0) continue;
      keypoints.emplace_back(x, y, static_cast<float>(point.scale) * kSizePerScale, -1.0f,
                             static_cast<float>(point.score), 0, point.laplacian > 0 ? 1 : -1);
    }
  }

  // Describes the keypoints that lie far enough inside; drops the others, as cv::Feature2D::compute may.
  static void Describe(const Integral& integral, std::vector<cv::KeyPoint>& keypoints,
                       cv::OutputArray descriptors) {
    std::vector<cv::KeyPoint> kept;
    cv::Mat rows(static_cast<int>(keypoints.size()), kDescriptorSize, CV_32F);
    for (cv::KeyPoint keypoint : keypoints) {
      const dlib::vector<double, 2> centre(keypoint.pt.x, keypoint.pt.y);
      const double scale = static_cast<double>(keypoint.size / kSizePerScale);
      if (scale <= 0 || !Describable(integral, centre, scale)) continue;
      const double angle = DominantAngle(integral, centre, scale);
      SurfDescriptor(integral, centre, scale, angle, rows.ptr<float>(static_cast<int>(kept.size())));
      keypoint.angle = static_cast<float>(angle * 180.0 / CV_PI);
      if (keypoint.angle < 0) keypoint.angle += 360.0f;
      kept.push_back(keypoint);
    }
    keypoints.swap(kept);
    rows.rowRange(0, static_cast<int>(keypoints.size())).copyTo(descriptors);
  }

  int max_features_;
  int octaves_;
  double threshold_;
  internal::ScratchPool<Scratch> scratches_;
};

}  // namespace

cv::Ptr<cv::Feature2D> CreateDlibSurf(int max_features, int octaves, double threshold) {
  return cv::makePtr<DlibSurf>(max_features, octaves, threshold);
}

}  // namespace tutti
