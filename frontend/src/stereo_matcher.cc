#include "stereo_matcher.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tutti {
namespace {

constexpr int kMaxDistance = 75;  // bits; a wrong match has about 128
constexpr int kHalf = 5;          // half of the SAD window [px]
constexpr int kSearch = 5;        // half of the SAD search range [px]

// Sum of absolute differences of two windows, each relative to its own centre (so that brightness may
// differ).
int Sad(const cv::Mat& a, int ax, int ay, const cv::Mat& b, int bx, int by) {
  const int ca = a.at<std::uint8_t>(ay, ax), cb = b.at<std::uint8_t>(by, bx);
  int sum = 0;
  for (int dy = -kHalf; dy <= kHalf; ++dy) {
    const std::uint8_t* ra = a.ptr<std::uint8_t>(ay + dy) + ax;
    const std::uint8_t* rb = b.ptr<std::uint8_t>(by + dy) + bx;
    for (int dx = -kHalf; dx <= kHalf; ++dx) sum += std::abs((ra[dx] - ca) - (rb[dx] - cb));
  }
  return sum;
}

// Offset of a parabola's minimum through three values at -1, 0, 1.
double Vertex(double left, double centre, double right) {
  const double curvature = left + right - 2 * centre;
  return curvature > 0 ? 0.5 * (left - right) / curvature : 0.0;
}

struct Refined {
  double u = 0, row_error = 0;  // level-0 pixels
  int sad = 0;
};

// Sub-pixel column of the match and its row difference; false if the minimum lies at the end of the range.
bool Refine(const cv::Mat& left, const cv::Mat& right, float scale, const cv::Point2f& left_point,
            float right_u, Refined* out) {
  const int x = static_cast<int>(std::lround((left_point.x + 0.5F) / scale - 0.5F)),
            y = static_cast<int>(std::lround((left_point.y + 0.5F) / scale - 0.5F));
  const int x0 = static_cast<int>(std::lround((right_u + 0.5F) / scale - 0.5F));
  const int margin = kHalf + 1;
  if (x < margin || y < margin || x + margin >= left.cols || y + margin >= left.rows) return false;
  if (x0 - kSearch < margin || x0 + kSearch + margin >= right.cols || y + margin >= right.rows) return false;
  int sads[2 * kSearch + 1];
  int best = 0;
  for (int d = -kSearch; d <= kSearch; ++d) {
    sads[d + kSearch] = Sad(left, x, y, right, x0 + d, y);
    if (sads[d + kSearch] < sads[best]) best = d + kSearch;
  }
  if (best == 0 || best == 2 * kSearch) return false;
  const double du = Vertex(sads[best - 1], sads[best], sads[best + 1]);
  const int xr = x0 + best - kSearch;
  const int above = Sad(left, x, y, right, xr, y - 1), below = Sad(left, x, y, right, xr, y + 1);
  const double dv = std::clamp(Vertex(above, sads[best], below), -1.0, 1.0);
  out->sad = sads[best];
  // The offset is relative to the left keypoint's rounded position, so the fraction of the keypoint itself
  // drops out.
  out->u = left_point.x + scale * (xr + du - x);
  out->row_error = std::abs(dv) * scale;
  return true;
}

}  // namespace

void MatchStereo(const std::vector<cv::Mat>& left_pyramid, const std::vector<cv::Mat>& right_pyramid,
                 const Features& right, const CameraRig& rig, const OdometryOptions& options,
                 Features* left) {
  const std::vector<float> scales = PyramidScales(options);
  const int rows = left_pyramid[0].rows;
  const double fb = rig.camera.fx * rig.baseline_m;
  // Right features by row; each stands in all the rows in which a left feature may match it.
  std::vector<std::vector<int>> by_row(static_cast<std::size_t>(rows));
  for (std::size_t j = 0; j < right.size(); ++j) {
    const cv::KeyPoint& k = right.keypoints[j];
    const float band = 2.0F * scales[static_cast<std::size_t>(k.octave)];
    const int first = std::max(0, static_cast<int>(std::floor(k.pt.y - band)));
    const int last = std::min(rows - 1, static_cast<int>(std::ceil(k.pt.y + band)));
    for (int r = first; r <= last; ++r) by_row[static_cast<std::size_t>(r)].push_back(static_cast<int>(j));
  }
  struct Found {
    std::size_t feature;
    double disparity, row_error;
    int sad;
  };
  std::vector<Found> found;
  // The nearest point that is looked for: half a baseline away would leave no overlap.
  const float max_disparity = static_cast<float>(rig.camera.fx / 1.5);
  for (std::size_t i = 0; i < left->size(); ++i) {
    const cv::KeyPoint& k = left->keypoints[i];
    int best = kMaxDistance, best_j = -1;
    for (int j :
         by_row[static_cast<std::size_t>(std::clamp(static_cast<int>(std::lround(k.pt.y)), 0, rows - 1))]) {
      const cv::KeyPoint& r = right.keypoints[static_cast<std::size_t>(j)];
      if (std::abs(r.octave - k.octave) > 1 || r.pt.x > k.pt.x + 2 || r.pt.x < k.pt.x - max_disparity)
        continue;
      const int distance = HammingDistance(left->Descriptor(static_cast<int>(i)), right.Descriptor(j));
      if (distance < best) {
        best = distance;
        best_j = j;
      }
    }
    if (best_j < 0) continue;
    const std::size_t level = static_cast<std::size_t>(k.octave);
    if (level >= right_pyramid.size()) continue;
    Refined refined;
    if (!Refine(left_pyramid[level], right_pyramid[level], scales[level], k.pt,
                right.keypoints[static_cast<std::size_t>(best_j)].pt.x, &refined)) {
      continue;
    }
    const double disparity = k.pt.x - refined.u;
    if (disparity < -1.0 || disparity > max_disparity) continue;
    found.push_back({i, std::max(disparity, 0.01), refined.row_error, refined.sad});
  }
  if (found.empty()) return;
  // Matches whose windows differ far more than the median's are wrong (Mur-Artal & Tardos, T-RO 2017, section
  // III-A).
  std::vector<int> sads;
  for (const Found& f : found) sads.push_back(f.sad);
  std::nth_element(sads.begin(), sads.begin() + static_cast<std::ptrdiff_t>(sads.size() / 2), sads.end());
  const double limit = 2.1 * sads[sads.size() / 2];
  std::vector<double> errors;
  for (const Found& f : found) {
    if (f.sad > limit) continue;
    const float scale = scales[static_cast<std::size_t>(left->keypoints[f.feature].octave)];
    left->inverse_depth[f.feature] = static_cast<float>(f.disparity / fb);
    left->inverse_depth_sigma[f.feature] = static_cast<float>(options.stereo_sigma_px * scale / fb);
    errors.push_back(f.row_error);
  }
  left->stereo_matches = static_cast<int>(errors.size());
  if (errors.empty()) return;
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2),
                   errors.end());
  left->row_error_px = errors[errors.size() / 2];
}

}  // namespace tutti
