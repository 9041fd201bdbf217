#include "loopclosure/features/sift.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/inner_loops.h"
#include "core/numbers.h"
#include "loopclosure/features/smoothing.h"

namespace tutti::internal {
namespace {

constexpr int kLayers = 3;                   // of an octave in which points are found
constexpr int kBlurs = SiftScratch::kBlurs;  // images of an octave
static_assert(kBlurs == kLayers + 3, "enough for the layers");
constexpr double kSigma = 1.6;       // of an octave's first image [px]
constexpr int kBorder = 5;           // no point is nearer to the border of its octave [px]
constexpr int kSteps = 5;            // of the interpolation
constexpr float kEdgeRatio = 10.0f;  // of principal curvatures, beyond which a point is an edge's

using Octave = SiftScratch::Octave;

struct Point {
  int octave = 0;
  int layer = 0;          // image of the octave that describes it
  cv::Point2f at;         // [px of the octave]
  float scale = 0;        // [px of the octave]
  float response = 0;     // contrast, of 255
  float angle_deg = 0.0;  // as cv::KeyPoint has it
};

void Build(const cv::Mat& image, double blur, SiftScratch& scratch) {
  const int side = std::min(image.rows, image.cols);
  const int octaves = std::max(1, cvRound(std::log2(static_cast<double>(side))) - 2);
  std::vector<Octave>& pyramid = scratch.pyramid;
  pyramid.resize(Index(octaves));
  const double step = std::pow(2.0, 1.0 / kLayers);
  for (std::size_t o = 0; o < pyramid.size(); ++o) {
    if (o == 0) {
      image.convertTo(scratch.values, CV_32F);
      GaussianBlur(scratch.values, std::sqrt(std::max(0.01, kSigma * kSigma - blur * blur)), pyramid[0][0]);
    } else {
      cv::resize(pyramid[o - 1][kLayers], pyramid[o][0], cv::Size(), 0.5, 0.5, cv::INTER_NEAREST);
    }
    double sigma = kSigma;
    for (std::size_t i = 1; i < kBlurs; ++i) {
      GaussianBlur(pyramid[o][i - 1], sigma * std::sqrt(step * step - 1.0), pyramid[o][i]);
      sigma *= step;
    }
  }
}

// A line of the difference of two neighbouring images of an octave, from any of its pixels on.
struct Line {
  const float* fine;
  const float* coarse;
  float operator[](int c) const { return coarse[c] - fine[c]; }
};

Line Difference(const Octave& octave, int layer, int row, int col) {
  const auto i = Index(layer);
  return {octave[i].ptr<float>(row) + col, octave[i + 1].ptr<float>(row) + col};
}

// Largest or smallest of its 26 neighbours.
bool IsExtremum(const Octave& octave, int layer, int row, int col) {
  const float value = Difference(octave, layer, row, col)[0];
  for (int l = layer - 1; l <= layer + 1; ++l) {
    for (int r = row - 1; r <= row + 1; ++r) {
      const Line line = Difference(octave, l, r, col);
      for (int c = -1; c <= 1; ++c) {
        if (value > 0 ? line[c] > value : line[c] < value) return false;
      }
    }
  }
  return true;
}

// Moves a point to the extremum of the parabola through its neighbours; false if there is none nearby, or its
// contrast is too small, or it lies on an edge.
bool Refine(const Octave& octave, int layer, int row, int col, float least, Point& point) {
  cv::Vec3f offset;
  for (int step = 0;; ++step) {
    const Line h = Difference(octave, layer, row, col);
    const Line u = Difference(octave, layer, row - 1, col);
    const Line d = Difference(octave, layer, row + 1, col);
    const Line b = Difference(octave, layer - 1, row, col);
    const Line a = Difference(octave, layer + 1, row, col);
    const Line bu = Difference(octave, layer - 1, row - 1, col);
    const Line bd = Difference(octave, layer - 1, row + 1, col);
    const Line au = Difference(octave, layer + 1, row - 1, col);
    const Line ad = Difference(octave, layer + 1, row + 1, col);
    const cv::Vec3f slope(0.5f * (h[1] - h[-1]), 0.5f * (d[0] - u[0]), 0.5f * (a[0] - b[0]));
    const float xx = h[1] + h[-1] - 2 * h[0];
    const float yy = d[0] + u[0] - 2 * h[0];
    const float ss = a[0] + b[0] - 2 * h[0];
    const float xy = 0.25f * (d[1] - d[-1] - u[1] + u[-1]);
    const float xs = 0.25f * (a[1] - a[-1] - b[1] + b[-1]);
    const float ys = 0.25f * (ad[0] - au[0] - bd[0] + bu[0]);
    offset = -(cv::Matx33f(xx, xy, xs, xy, yy, ys, xs, ys, ss).solve(slope, cv::DECOMP_LU));
    const float farthest = std::max({std::abs(offset[0]), std::abs(offset[1]), std::abs(offset[2])});
    if (farthest < 0.5f) {
      const float contrast = h[0] + 0.5f * slope.dot(offset);
      const float trace = xx + yy;
      const float det = xx * yy - xy * xy;
      if (std::abs(contrast) < least || det <= 0) return false;
      if (trace * trace * kEdgeRatio >= (kEdgeRatio + 1) * (kEdgeRatio + 1) * det) return false;
      point.response = std::abs(contrast);
      break;
    }
    if (step + 1 >= kSteps || !(farthest < 1e6f)) return false;
    col += cvRound(offset[0]);
    row += cvRound(offset[1]);
    layer += cvRound(offset[2]);
    if (layer < 1 || layer > kLayers || col < kBorder || col >= octave[0].cols - kBorder || row < kBorder ||
        row >= octave[0].rows - kBorder) {
      return false;
    }
  }
  point.layer = layer;
  point.at = cv::Point2f(static_cast<float>(col) + offset[0], static_cast<float>(row) + offset[1]);
  point.scale =
      static_cast<float>(kSigma) * std::pow(2.0f, (static_cast<float>(layer) + offset[2]) / float{kLayers});
  return true;
}

// These are std::max and std::min, which sanitizers would not let be inlined below.
TUTTI_CHECKED_AS_A_WHOLE inline float Larger(float a, float b) { return a < b ? b : a; }
TUTTI_CHECKED_AS_A_WHOLE inline float Smaller(float a, float b) { return b < a ? b : a; }

TUTTI_CHECKED_AS_A_WHOLE void WriteOut(const Line& line, int cols, float* to) {
  const float *fine = line.fine, *coarse = line.coarse;
  CheckReadable(fine, Index(cols));
  CheckReadable(coarse, Index(cols));
  CheckWritable(to, Index(cols));
  for (int c = 0; c < cols; ++c) to[c] = coarse[c] - fine[c];
}

// Where a row of differences is above or below its nearest neighbours: what may be an extremum.
TUTTI_CLONES("avx2")
TUTTI_CHECKED_AS_A_WHOLE void Candidates(const float* h, const float* u, const float* d, const float* b,
                                         const float* a, int cols, float least, std::uint8_t* found) {
  for (const float* line : {h, u, d, b, a}) CheckReadable(line, Index(cols));
  CheckWritable(found, Index(cols));
  for (int c = kBorder; c < cols - kBorder; ++c) {
    const float high =
        Larger(Larger(Larger(h[c - 1], h[c + 1]), Larger(u[c], d[c])), Larger(Larger(a[c], b[c]), least));
    const float low = Smaller(Smaller(Smaller(h[c - 1], h[c + 1]), Smaller(u[c], d[c])),
                              Smaller(Smaller(a[c], b[c]), -least));
    found[c] = static_cast<std::uint8_t>((h[c] >= high) | (h[c] <= low));
  }
}

// The first place from `c` on at which something was found, or `past`; few are.
int NextFound(const std::uint8_t* found, int c, int past) {
  for (std::uint64_t eight = 0; c + 8 <= past; c += 8) {
    std::memcpy(&eight, found + c, sizeof eight);
    if (eight != 0) break;
  }
  while (c < past && found[c] == 0) ++c;
  return c;
}

std::vector<Point> Detect(SiftScratch& scratch, float least) {
  std::vector<Point> points;
  for (std::size_t o = 0; o < scratch.pyramid.size(); ++o) {
    const Octave& octave = scratch.pyramid[o];
    const int rows = octave[0].rows;
    const int cols = octave[0].cols;
    if (std::min(rows, cols) <= 2 * kBorder) break;
    scratch.found.assign(Index(cols), 0);
    // Three lines of each difference, in turns: they stay in the cache.
    scratch.lines.create(3 * (kBlurs - 1), cols, CV_32F);
    const auto line = [&](int layer, int row) { return scratch.lines.ptr<float>(3 * layer + row % 3); };
    const auto fill = [&](int row) {
      for (int layer = 0; layer < kBlurs - 1; ++layer) {
        WriteOut(Difference(octave, layer, row, 0), cols, line(layer, row));
      }
    };
    fill(kBorder - 1);
    fill(kBorder);
    for (int r = kBorder; r < rows - kBorder; ++r) {
      fill(r + 1);
      for (int layer = 1; layer <= kLayers; ++layer) {
        Candidates(line(layer, r), line(layer, r - 1), line(layer, r + 1), line(layer - 1, r),
                   line(layer + 1, r), cols, 0.5f * least, scratch.found.data());
        const std::uint8_t* found = scratch.found.data();
        for (int c = NextFound(found, kBorder, cols); c < cols; c = NextFound(found, c + 1, cols)) {
          if (!IsExtremum(octave, layer, r, c)) continue;
          Point point;
          point.octave = static_cast<int>(o);
          if (Refine(octave, layer, r, c, least, point)) points.push_back(point);
        }
      }
    }
  }
  return points;
}

cv::KeyPoint InImage(const Point& point) {
  const float zoom = static_cast<float>(1 << point.octave);
  cv::KeyPoint keypoint(point.at * zoom, 2 * point.scale * zoom, point.angle_deg, point.response);
  keypoint.octave = point.octave;
  return keypoint;
}

}  // namespace

Features ExtractSift(const cv::Mat& image, double blur, const SiftOptions& options, SiftScratch& scratch) {
  Build(image, blur, scratch);
  const std::vector<Octave>& pyramid = scratch.pyramid;
  const auto grey_levels = [](double contrast) { return static_cast<float>(contrast * 255.0 / kLayers); };
  const float wanted = grey_levels(options.contrast);
  std::vector<Point> points = Detect(scratch, std::min(wanted, grey_levels(options.least_contrast)));
  std::stable_sort(points.begin(), points.end(),
                   [](const Point& a, const Point& b) { return a.response > b.response; });
  const auto most = Index(options.features);
  while (points.size() > most && points.back().response < wanted) points.pop_back();
  points.resize(std::min(points.size(), 2 * most));

  std::vector<cv::KeyPoint> places;
  places.reserve(points.size());
  for (const Point& point : points) places.push_back(InImage(point));
  Features features;
  features.descriptors.create(options.features, static_cast<int>(kSiftValues), CV_32F);
  for (const int i : SelectSpread(places, image.size(), options.features)) {
    Point point = points[Index(i)];
    const cv::Mat& described = pyramid[Index(point.octave)][Index(point.layer)];
    for (const float angle : SiftOrientations(described, point.at, point.scale)) {
      if (features.keypoints.size() == most) break;
      point.angle_deg = 360.0f - angle;
      if (point.angle_deg >= 360.0f) point.angle_deg -= 360.0f;
      DescribeSift(described, point.at, point.scale, point.angle_deg,
                   features.descriptors.ptr<float>(static_cast<int>(features.keypoints.size())));
      features.keypoints.push_back(InImage(point));
    }
  }
  features.descriptors =
      features.descriptors.rowRange(0, static_cast<int>(features.keypoints.size())).clone();
  return features;
}

}  // namespace tutti::internal
