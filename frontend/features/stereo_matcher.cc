// Depth of left features from a rectified stereo pair.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/eigen_bits.h"
#include "core/inner_loops.h"
#include "core/numbers.h"
#include "frontend/features/features.h"
#include "frontend/features/grey_window.h"

namespace tutti {
namespace {

constexpr int kMaxDistance = 75;  // bits; a wrong match has about 128
constexpr int kHalf = 5;          // half of the window [px]
constexpr int kSide = 2 * kHalf + 1;
constexpr int kPixels = kSide * kSide;
constexpr int kSearch = 5;              // half of the SAD search range [px]
constexpr float kGreySigma = 4;         // differences that interpolation and noise make [grey levels]
constexpr float kMaxStretch = 0.3F;     // of a wall along the way: baseline / distance from it
constexpr float kMaxShear = 0.8F;       // of the ground: baseline / height
constexpr float kMaxResidual = 0.3F;    // of the window's variance
constexpr float kResidualRatio = 6.0F;  // to the median of all matches

// Sum of absolute differences of two windows, whose middles and rows' lengths in bytes are given, each
// relative to its own centre (so that brightness may differ).
TUTTI_CHECKED_AS_A_WHOLE int Sad(const std::uint8_t* a, std::size_t a_step, const std::uint8_t* b,
                                 std::size_t b_step) {
  const int ca = *a, cb = *b;
  a -= kHalf * a_step;
  b -= kHalf * b_step;
  int sum = 0;
  for (int dy = -kHalf; dy <= kHalf; ++dy, a += a_step, b += b_step) {
    for (int dx = -kHalf; dx <= kHalf; ++dx) {
      const int difference = (a[dx] - ca) - (b[dx] - cb);
      sum += difference < 0 ? -difference : difference;
    }
  }
  return sum;
}

// For Sad: windows of the image with middles up to `aside` pixels left and right of (x, y).
void CheckWindows(const cv::Mat& image, int x, int y, int aside) {
  const int count = kSide + 2 * aside;
  internal::CheckReadableRows(image.ptr<std::uint8_t>(y - kHalf) + x - kHalf - aside, kSide,
                              static_cast<int>(image.step), static_cast<std::size_t>(count));
}

using Window = GreyWindow<kHalf>;
using Vector5f = Eigen::Matrix<float, 5, 1>;

// How a window of the left image appears in the right one, in pixels of the level:
// right(x + i + shift + stretch i + shear j, y + j + row) = left(x + i, y + j) + brightness.
struct Warp {
  float shift = 0, stretch = 0, shear = 0, row = 0, brightness = 0;
  float residual = 0;  // weighted mean square difference [grey levels^2]
  float contrast = 0;  // weighted variance of the left window [grey levels^2]
};

// Grey values at (x + gain i, y) for all pixels i of a window's row.
TUTTI_CHECKED_AS_A_WHOLE void SampleRow(const std::uint8_t* data, std::size_t step, float x, float gain,
                                        float y, float* grey) {
  const int left = static_cast<int>(x - gain * kHalf), right = static_cast<int>(x + gain * kHalf) + 1;
  const std::uint8_t* first = data + static_cast<std::size_t>(y) * step + left;
  const int count = right - left + 1;
  internal::CheckReadableRows(first, 2, static_cast<int>(step), static_cast<std::size_t>(count));
  for (int i = -kHalf; i <= kHalf; ++i)
    grey[i + kHalf] = Bilinear(data, step, x + gain * static_cast<float>(i), y);
}

// Grey values of the left window, shifted and warped, in the right image; false if it reaches beyond the
// image.
bool SampleWarped(const cv::Mat& right, int x, int y, const Warp& w, Window* grey) {
  const float h = kHalf, fx = static_cast<float>(x), fy = static_cast<float>(y);
  const float reach = h * (1 + std::abs(w.stretch) + std::abs(w.shear));
  if (!(fx + w.shift - reach >= 0 && fx + w.shift + reach < static_cast<float>(right.cols - 1) &&
        fy + w.row - h >= 0 && fy + w.row + h < static_cast<float>(right.rows - 1)))
    return false;
  for (int j = -kHalf; j <= kHalf; ++j)
    SampleRow(right.data, right.step, fx + w.shift + w.shear * static_cast<float>(j), 1 + w.stretch,
              fy + static_cast<float>(j) + w.row, grey->data() + (j + kHalf) * kSide);
  return true;
}

// Least squares with the left image's gradients (Lucas & Kanade, IJCAI 1981), from warp->shift on. A window
// on the ground or on a wall along the way is sheared or stretched by pixels: a mere shift has errors of half
// a pixel there.
bool FitWarp(const cv::Mat& left, const cv::Mat& right, int x, int y, Warp* warp) {
  const Window& weights = WindowWeights<kHalf>();
  Eigen::Matrix<float, kPixels, 5> jacobian;
  Window grey;
  for (int j = -kHalf, n = 0; j <= kHalf; ++j) {
    const std::uint8_t* row = left.ptr<std::uint8_t>(y + j) + x;
    const std::uint8_t* above = left.ptr<std::uint8_t>(y + j - 1) + x;
    const std::uint8_t* below = left.ptr<std::uint8_t>(y + j + 1) + x;
    for (int i = -kHalf; i <= kHalf; ++i, ++n) {
      const float gx = 0.5F * static_cast<float>(row[i + 1] - row[i - 1]);
      const float gy = 0.5F * static_cast<float>(below[i] - above[i]);
      jacobian(n, 0) = gx;
      jacobian(n, 1) = gx * static_cast<float>(i);
      jacobian(n, 2) = gx * static_cast<float>(j);
      jacobian(n, 3) = gy;
      jacobian(n, 4) = -1.0F;
      grey(n) = row[i];
    }
  }
  warp->contrast = weights.dot((grey.array() - weights.dot(grey)).square().matrix());
  Eigen::Matrix<float, kPixels, 5> weighted;
  for (int c = 0; c < 5; ++c) weighted.col(c) = weights.cwiseProduct(jacobian.col(c));
  Eigen::Matrix<float, 5, 5> h = weighted.transpose() * jacobian;
  // What is usual, for windows that say little about it; as if one pixel of sixty had told.
  const auto usual = [](float sigma) { return 0.018F * kGreySigma * kGreySigma / (sigma * sigma); };
  const Vector5f prior(0.0F, usual(0.2F), usual(0.3F), usual(0.5F), 0.0F);
  h.diagonal() += prior;
  const Eigen::LDLT<Eigen::Matrix<float, 5, 5>> solver(h);
  if (solver.info() != Eigen::Success || !(solver.vectorD().minCoeff() > 1e-4F)) return false;
  const float start = warp->shift;
  for (int iteration = 0; iteration < 10; ++iteration) {
    Window r;
    if (!SampleWarped(right, x, y, *warp, &r)) return false;
    r.array() -= grey.array() + warp->brightness;
    warp->residual = weights.dot(r.cwiseAbs2());
    const Vector5f now(0, warp->stretch, warp->shear, warp->row, 0);
    Vector5f step = -(weighted.transpose() * r + prior.cwiseProduct(now));
    internal::small_ldlt::SolveInPlace<5>(solver, step.data());
    warp->shift += step(0);
    warp->stretch += step(1);
    warp->shear += step(2);
    warp->row += step(3);
    warp->brightness += step(4);
    if (!(std::abs(warp->shift - start) < 3 && std::abs(warp->stretch) < kMaxStretch &&
          std::abs(warp->shear) < kMaxShear && std::abs(warp->row) < 2))
      return false;
    if (std::abs(step(0)) < 0.01F) return true;  // what is left is less than half of it
  }
  return false;
}

struct Refined {
  std::size_t feature = 0;
  double disparity = 0, row_error = 0;  // level-0 pixels
  float residual = 0;                   // [grey levels^2]
};

// Sub-pixel disparity of a match at the left keypoint; false if there is no clear minimum near the right one.
bool Refine(const cv::Mat& left, const cv::Mat& right, const cv::Point2f& scale,
            const cv::Point2f& left_point, float right_u, Refined* out) {
  const float u = (left_point.x + 0.5F) / scale.x - 0.5F, v = (left_point.y + 0.5F) / scale.y - 0.5F;
  const int x = static_cast<int>(std::lround(u)), y = static_cast<int>(std::lround(v));
  const int x0 = static_cast<int>(std::lround((right_u + 0.5F) / scale.x - 0.5F));
  const int margin = kHalf + 1;
  if (x < margin || y < margin || x + margin >= left.cols || y + margin >= left.rows) return false;
  if (x0 - kSearch < margin || x0 + kSearch + margin >= right.cols || y + margin >= right.rows) return false;
  CheckWindows(left, x, y, 0);
  CheckWindows(right, x0, y, kSearch);
  const std::uint8_t *at_left = left.ptr<std::uint8_t>(y) + x, *at_right = right.ptr<std::uint8_t>(y) + x0;
  int best = 0, least = std::numeric_limits<int>::max();
  for (int d = -kSearch; d <= kSearch; ++d) {
    const int sad = Sad(at_left, left.step, at_right + d, right.step);
    if (sad < least) {
      least = sad;
      best = d;
    }
  }
  if (std::abs(best) == kSearch) return false;
  Warp warp;
  warp.shift = static_cast<float>(x0 + best - x);
  if (!FitWarp(left, right, x, y, &warp)) return false;
  if (warp.residual > kMaxResidual * warp.contrast) return false;
  // The window's centre is the rounded keypoint.
  out->disparity = -double(scale.x) * double(warp.shift + warp.stretch * (u - static_cast<float>(x)) +
                                             warp.shear * (v - static_cast<float>(y)));
  out->row_error = std::abs(warp.row) * scale.y;
  out->residual = warp.residual;
  return true;
}

// Right features by row; each stands in all the rows in which a left feature may match it.
std::vector<std::vector<int>> ByRow(const FrameFeatures& right, const std::vector<float>& scales, int rows) {
  std::vector<std::vector<int>> by_row(static_cast<std::size_t>(rows));
  for (std::size_t j = 0; j < right.size(); ++j) {
    const cv::KeyPoint& k = right.keypoints[j];
    const float band = 2.0F * scales[static_cast<std::size_t>(k.octave)];
    const int first = std::max(0, static_cast<int>(std::floor(k.pt.y - band)));
    const int last = std::min(rows - 1, static_cast<int>(std::ceil(k.pt.y + band)));
    for (int r = first; r <= last; ++r) by_row[static_cast<std::size_t>(r)].push_back(static_cast<int>(j));
  }
  return by_row;
}

// The right feature of these that looks most like left feature i; -1: none does.
int BestMatch(const FrameFeatures& left, std::size_t i, const FrameFeatures& right,
              const std::vector<int>& in_row, float max_disparity) {
  const cv::KeyPoint& k = left.keypoints[i];
  int best = kMaxDistance, best_j = -1;
  for (const int j : in_row) {
    const cv::KeyPoint& r = right.keypoints[static_cast<std::size_t>(j)];
    if (std::abs(r.octave - k.octave) > 1 || r.pt.x > k.pt.x + 2 || r.pt.x < k.pt.x - max_disparity) continue;
    const int distance = HammingDistance(left.Descriptor(static_cast<int>(i)), right.Descriptor(j));
    if (distance >= best) continue;
    best = distance;
    best_j = j;
  }
  return best_j;
}

}  // namespace

void MatchStereo(const std::vector<cv::Mat>& left_pyramid, const std::vector<cv::Mat>& right_pyramid,
                 const FrameFeatures& right, const CameraRig& rig, const OdometryOptions& options,
                 FrameFeatures* left) {
  const std::vector<float> scales = PyramidScales(options);
  const int rows = left_pyramid[0].rows;
  const double fb = rig.camera.fx * rig.baseline_m;
  const std::vector<std::vector<int>> by_row = ByRow(right, scales, rows);
  std::vector<Refined> found;
  // The nearest point that is looked for: half a baseline away would leave no overlap.
  const float max_disparity = static_cast<float>(rig.camera.fx / 1.5);
  for (std::size_t i = 0; i < left->size(); ++i) {
    const cv::KeyPoint& k = left->keypoints[i];
    const int row = std::clamp(static_cast<int>(std::lround(k.pt.y)), 0, rows - 1);
    const int j = BestMatch(*left, i, right, by_row[static_cast<std::size_t>(row)], max_disparity);
    const std::size_t level = static_cast<std::size_t>(k.octave);
    if (j < 0 || level >= right_pyramid.size()) continue;
    Refined refined;
    if (!Refine(left_pyramid[level], right_pyramid[level], LevelScale(left_pyramid[0], left_pyramid[level]),
                k.pt, right.keypoints[static_cast<std::size_t>(j)].pt.x, &refined))
      continue;
    if (refined.disparity < -1.0 || refined.disparity > max_disparity) continue;
    refined.feature = i;
    refined.disparity = std::max(refined.disparity, 0.01);
    found.push_back(refined);
  }
  if (found.empty()) return;
  // Matches whose windows differ far more than the median's are wrong (Mur-Artal & Tardos, T-RO 2017, section
  // III-A).
  std::vector<float> residuals;
  for (const Refined& f : found) residuals.push_back(f.residual);
  const float limit = kResidualRatio * internal::Median(std::move(residuals));
  std::vector<double> errors;
  for (const Refined& f : found) {
    if (f.residual > limit) continue;
    const float scale = scales[static_cast<std::size_t>(left->keypoints[f.feature].octave)];
    left->inverse_depth[f.feature] = static_cast<float>(f.disparity / fb);
    left->inverse_depth_sigma[f.feature] = static_cast<float>(options.stereo_sigma_px * scale / fb);
    errors.push_back(f.row_error);
  }
  left->stereo_matches = static_cast<int>(errors.size());
  if (!errors.empty()) left->row_error_px = internal::Median(std::move(errors));
}

}  // namespace tutti
