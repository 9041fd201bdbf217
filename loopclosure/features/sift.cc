#include "loopclosure/features/sift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core/hal/hal.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace tutti::internal {
namespace {

constexpr int kLayers = 3;                   // of an octave in which points are found
constexpr int kBlurs = SiftScratch::kBlurs;  // images of an octave
static_assert(kBlurs == kLayers + 3, "enough for the layers");
constexpr double kSigma = 1.6;       // of an octave's first image [px]
constexpr int kBorder = 5;           // no point is nearer to the border of its octave [px]
constexpr int kSteps = 5;            // of the interpolation
constexpr float kEdgeRatio = 10.0f;  // of principal curvatures, beyond which a point is an edge's
constexpr int kAngleBins = 36;
constexpr float kAnglePeak = 0.8f;   // of the highest, from which on a peak is an orientation, too
constexpr float kAngleSigma = 1.5f;  // of the window, in scales
constexpr int kCells = 4;            // of a descriptor, each way
constexpr int kCellBins = 8;         // directions of a cell
constexpr float kCellScales = 3.0f;  // width of a cell
constexpr float kClip = 0.2f;        // largest value of a descriptor of length 1
constexpr float kLength = 512.0f;    // of a descriptor
constexpr int kGrid = 24;            // samples of a descriptor, each way: along 5 cells
constexpr int kSamples = kGrid * kGrid;
constexpr int kPadded = kCells + 2;  // with a margin that takes what falls outside
constexpr std::size_t kDescriptorSize = kCells * kCells * kCellBins;

using Octave = SiftScratch::Octave;

struct Point {
  int octave = 0;
  int layer = 0;          // image of the octave that describes it
  cv::Point2f at;         // [px of the octave]
  float scale = 0;        // [px of the octave]
  float response = 0;     // contrast, of 255
  float angle_deg = 0.0;  // as cv::KeyPoint has it
};

void Blur(const cv::Mat& from, double sigma, cv::Mat& to) {
  const int width = 2 * static_cast<int>(std::ceil(3.0 * sigma)) + 1;
  cv::GaussianBlur(from, to, cv::Size(width, width), sigma, sigma, cv::BORDER_REFLECT_101);
}

void Build(const cv::Mat& image, double blur, SiftScratch& scratch) {
  const int side = std::min(image.rows, image.cols);
  const int octaves = std::max(1, cvRound(std::log2(static_cast<double>(side))) - 2);
  std::vector<Octave>& pyramid = scratch.pyramid;
  pyramid.resize(static_cast<std::size_t>(octaves));
  const double step = std::pow(2.0, 1.0 / kLayers);
  for (std::size_t o = 0; o < pyramid.size(); ++o) {
    if (o == 0) {
      image.convertTo(scratch.values, CV_32F);
      Blur(scratch.values, std::sqrt(std::max(0.01, kSigma * kSigma - blur * blur)), pyramid[0][0]);
    } else {
      cv::resize(pyramid[o - 1][kLayers], pyramid[o][0], cv::Size(), 0.5, 0.5, cv::INTER_NEAREST);
    }
    double sigma = kSigma;
    for (std::size_t i = 1; i < kBlurs; ++i) {
      Blur(pyramid[o][i - 1], sigma * std::sqrt(step * step - 1.0), pyramid[o][i]);
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
  const auto i = static_cast<std::size_t>(layer);
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

// Where a row of differences is above or below its nearest neighbours: what may be an extremum.
void Candidates(const float* h, const float* u, const float* d, const float* b, const float* a, int cols,
                float least, std::uint8_t* found) {
  for (int c = kBorder; c < cols - kBorder; ++c) {
    const float high = std::max(std::max(std::max(h[c - 1], h[c + 1]), std::max(u[c], d[c])),
                                std::max(std::max(a[c], b[c]), least));
    const float low = std::min(std::min(std::min(h[c - 1], h[c + 1]), std::min(u[c], d[c])),
                               std::min(std::min(a[c], b[c]), -least));
    found[c] = static_cast<std::uint8_t>((h[c] >= high) | (h[c] <= low));
  }
}

std::vector<Point> Detect(SiftScratch& scratch, float least) {
  std::vector<Point> points;
  for (std::size_t o = 0; o < scratch.pyramid.size(); ++o) {
    const Octave& octave = scratch.pyramid[o];
    const int rows = octave[0].rows;
    const int cols = octave[0].cols;
    if (std::min(rows, cols) <= 2 * kBorder) break;
    scratch.found.assign(static_cast<std::size_t>(cols), 0);
    // Three lines of each difference, in turns: they stay in the cache.
    scratch.lines.create(3 * (kBlurs - 1), cols, CV_32F);
    const auto line = [&](int layer, int row) { return scratch.lines.ptr<float>(3 * layer + row % 3); };
    const auto fill = [&](int row) {
      for (int layer = 0; layer < kBlurs - 1; ++layer) {
        const Line from = Difference(octave, layer, row, 0);
        float* to = line(layer, row);
        for (int c = 0; c < cols; ++c) to[c] = from[c];
      }
    };
    fill(kBorder - 1);
    fill(kBorder);
    for (int r = kBorder; r < rows - kBorder; ++r) {
      fill(r + 1);
      for (int layer = 1; layer <= kLayers; ++layer) {
        Candidates(line(layer, r), line(layer, r - 1), line(layer, r + 1), line(layer - 1, r),
                   line(layer + 1, r), cols, 0.5f * least, scratch.found.data());
        for (int c = kBorder; c < cols - kBorder; ++c) {
          if (scratch.found[static_cast<std::size_t>(c)] == 0 || !IsExtremum(octave, layer, r, c)) continue;
          Point point;
          point.octave = static_cast<int>(o);
          if (Refine(octave, layer, r, c, least, point)) points.push_back(point);
        }
      }
    }
  }
  return points;
}

// Directions of the gradient that stand out around a point [deg, counter-clockwise].
std::vector<float> Orientations(const cv::Mat& image, const Point& point) {
  const int radius = cvRound(3.0f * kAngleSigma * point.scale);
  const float sigma = kAngleSigma * point.scale;
  const cv::Point centre(cvRound(point.at.x), cvRound(point.at.y));
  std::vector<float> falloff(static_cast<std::size_t>(radius + 1));
  for (int i = 0; i <= radius; ++i) {
    falloff[static_cast<std::size_t>(i)] = std::exp(-static_cast<float>(i * i) / (2 * sigma * sigma));
  }
  const int left = std::max(1, centre.x - radius);
  const int right = std::min(image.cols - 2, centre.x + radius);
  const int width = std::max(0, right - left + 1);
  std::vector<float> dx(static_cast<std::size_t>(width));
  std::vector<float> dy(dx.size());
  std::vector<float> length(dx.size());
  std::vector<float> angle(dx.size());
  std::array<float, kAngleBins> bins{};
  for (int y = std::max(1, centre.y - radius); y <= std::min(image.rows - 2, centre.y + radius); ++y) {
    const float* u = image.ptr<float>(y - 1) + left;
    const float* h = image.ptr<float>(y) + left;
    const float* d = image.ptr<float>(y + 1) + left;
    for (std::size_t i = 0; i < dx.size(); ++i) {
      dx[i] = h[i + 1] - *(h + i - 1);
      dy[i] = u[i] - d[i];
    }
    cv::hal::magnitude32f(dx.data(), dy.data(), length.data(), width);
    cv::hal::fastAtan32f(dy.data(), dx.data(), angle.data(), width, true);
    const float row_weight = falloff[static_cast<std::size_t>(std::abs(y - centre.y))];
    for (int i = 0; i < width; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const int bin = cvRound(angle[at] * (kAngleBins / 360.0f)) % kAngleBins;
      bins[static_cast<std::size_t>(bin)] +=
          length[at] * row_weight * falloff[static_cast<std::size_t>(std::abs(left + i - centre.x))];
    }
  }
  std::array<float, kAngleBins> smooth{};
  const auto bin = [&](int i) { return bins[static_cast<std::size_t>((i + kAngleBins) % kAngleBins)]; };
  for (int i = 0; i < kAngleBins; ++i) {
    smooth[static_cast<std::size_t>(i)] = (bin(i - 2) + bin(i + 2)) * (1.0f / 16) +
                                          (bin(i - 1) + bin(i + 1)) * (4.0f / 16) + bin(i) * (6.0f / 16);
  }
  const float least = kAnglePeak * *std::max_element(smooth.begin(), smooth.end());
  std::vector<float> angles;
  for (int i = 0; i < kAngleBins; ++i) {
    const float here = smooth[static_cast<std::size_t>(i)];
    const float before = smooth[static_cast<std::size_t>((i + kAngleBins - 1) % kAngleBins)];
    const float after = smooth[static_cast<std::size_t>((i + 1) % kAngleBins)];
    if (here <= before || here <= after || here < least) continue;
    const float top = static_cast<float>(i) + 0.5f * (before - after) / (before - 2 * here + after);
    angles.push_back(top * (360.0f / kAngleBins));
  }
  return angles;
}

// The samples of a descriptor: the same for all, but for scale and angle.
struct Sample {
  float x = 0;  // across and down [cells]
  float y = 0;
  int cell = 0;                       // first of the four cells that share it, in the padded histogram
  std::array<float, 4> weights = {};  // theirs
};

const std::array<Sample, kSamples>& Samples() {
  static const std::array<Sample, kSamples> samples = [] {
    std::array<Sample, kSamples> grid;
    const float spacing = static_cast<float>(kCells + 1) / kGrid;
    const float first = -0.5f * (kCells + 1) + 0.5f * spacing;
    for (int r = 0; r < kGrid; ++r) {
      for (int c = 0; c < kGrid; ++c) {
        const int at = r * kGrid + c;
        Sample& sample = grid[static_cast<std::size_t>(at)];
        sample.x = first + static_cast<float>(c) * spacing;
        sample.y = first + static_cast<float>(r) * spacing;
        const float cell_x = sample.x + 0.5f * kCells + 0.5f;  // of the padded histogram
        const float cell_y = sample.y + 0.5f * kCells + 0.5f;
        const int x = static_cast<int>(cell_x);
        const int y = static_cast<int>(cell_y);
        const float fx = cell_x - static_cast<float>(x);
        const float fy = cell_y - static_cast<float>(y);
        const float weight =
            std::exp(-(sample.x * sample.x + sample.y * sample.y) / (0.5f * kCells * kCells));
        sample.cell = (y * kPadded + x) * (kCellBins + 1);
        sample.weights = {weight * (1 - fy) * (1 - fx), weight * (1 - fy) * fx, weight * fy * (1 - fx),
                          weight * fy * fx};
      }
    }
    return grid;
  }();
  return samples;
}

void Describe(const cv::Mat& image, const Point& point, float* descriptor) {
  constexpr float kToRadians = static_cast<float>(CV_PI / 180.0);
  const float turned = 360.0f - point.angle_deg;
  const float cell = kCellScales * point.scale;
  const float cos = std::cos(turned * kToRadians) * cell;
  const float sin = std::sin(turned * kToRadians) * cell;
  std::array<float, kSamples> dx;
  std::array<float, kSamples> dy;
  std::array<float, kSamples> length;
  std::array<float, kSamples> angle;
  const std::array<Sample, kSamples>& samples = Samples();
  for (std::size_t i = 0; i < kSamples; ++i) {
    const Sample& sample = samples[i];
    const int x = cvRound(point.at.x + sample.x * cos + sample.y * sin);
    const int y = cvRound(point.at.y - sample.x * sin + sample.y * cos);
    if (x < 1 || y < 1 || x >= image.cols - 1 || y >= image.rows - 1) {
      dx[i] = dy[i] = 0;
      continue;
    }
    const float* h = image.ptr<float>(y) + x;
    dx[i] = h[1] - h[-1];
    dy[i] = *(image.ptr<float>(y - 1) + x) - *(image.ptr<float>(y + 1) + x);
  }
  cv::hal::magnitude32f(dx.data(), dy.data(), length.data(), kSamples);
  cv::hal::fastAtan32f(dy.data(), dx.data(), angle.data(), kSamples, true);

  constexpr int kStride = kCellBins + 1;  // the last direction is the first one, again
  std::array<float, kPadded * kPadded * kStride> bins{};
  for (std::size_t i = 0; i < kSamples; ++i) {
    float direction = (angle[i] - turned) * (kCellBins / 360.0f);
    if (direction < 0) direction += kCellBins;
    const int whole = std::min(static_cast<int>(direction), kCellBins - 1);
    const float after = length[i] * (direction - static_cast<float>(whole));
    const float before = length[i] - after;
    float* bin = bins.data() + samples[i].cell + whole;
    const std::array<float, 4>& weights = samples[i].weights;
    bin[0] += before * weights[0];
    bin[1] += after * weights[0];
    bin[kStride] += before * weights[1];
    bin[kStride + 1] += after * weights[1];
    bin[kPadded * kStride] += before * weights[2];
    bin[kPadded * kStride + 1] += after * weights[2];
    bin[(kPadded + 1) * kStride] += before * weights[3];
    bin[(kPadded + 1) * kStride + 1] += after * weights[3];
  }
  float* value = descriptor;
  for (int r = 1; r <= kCells; ++r) {
    for (int c = 1; c <= kCells; ++c) {
      const float* bin = bins.data() + (r * kPadded + c) * kStride;
      for (int k = 0; k < kCellBins; ++k) *value++ = bin[k] + (k == 0 ? bin[kCellBins] : 0.0f);
    }
  }
  const auto norm = [&] {
    float squares = 0;
    for (std::size_t i = 0; i < kDescriptorSize; ++i) squares += descriptor[i] * descriptor[i];
    return std::max(std::sqrt(squares), 1e-7f);
  };
  const float clip = kClip * norm();
  for (std::size_t i = 0; i < kDescriptorSize; ++i) descriptor[i] = std::min(descriptor[i], clip);
  const float scale = kLength / norm();
  for (std::size_t i = 0; i < kDescriptorSize; ++i) {
    descriptor[i] = static_cast<float>(cv::saturate_cast<std::uint8_t>(descriptor[i] * scale));
  }
}

cv::KeyPoint InImage(const Point& point) {
  const float zoom = static_cast<float>(1 << point.octave);
  cv::KeyPoint keypoint(point.at * zoom, 2 * point.scale * zoom, point.angle_deg, point.response);
  keypoint.octave = point.octave;
  return keypoint;
}

}  // namespace

Features ExtractSift(const cv::Mat& image, double blur, const ExtractionOptions& options,
                     SiftScratch& scratch) {
  Build(image, blur, scratch);
  const std::vector<Octave>& pyramid = scratch.pyramid;
  const auto grey_levels = [](double contrast) { return static_cast<float>(contrast * 255.0 / kLayers); };
  const float wanted = grey_levels(options.sift_contrast);
  std::vector<Point> points = Detect(scratch, std::min(wanted, grey_levels(options.sift_min_contrast)));
  std::stable_sort(points.begin(), points.end(),
                   [](const Point& a, const Point& b) { return a.response > b.response; });
  const auto most = static_cast<std::size_t>(options.features);
  while (points.size() > most && points.back().response < wanted) points.pop_back();
  points.resize(std::min(points.size(), 2 * most));

  std::vector<cv::KeyPoint> places;
  places.reserve(points.size());
  for (const Point& point : points) places.push_back(InImage(point));
  Features features;
  features.descriptors.create(options.features, static_cast<int>(kDescriptorSize), CV_32F);
  for (const int i : SelectSpread(places, image.size(), options.features, options.grid_columns)) {
    Point point = points[static_cast<std::size_t>(i)];
    const cv::Mat& described =
        pyramid[static_cast<std::size_t>(point.octave)][static_cast<std::size_t>(point.layer)];
    for (const float angle : Orientations(described, point)) {
      if (features.keypoints.size() == most) break;
      point.angle_deg = 360.0f - angle;
      if (point.angle_deg >= 360.0f) point.angle_deg -= 360.0f;
      Describe(described, point,
               features.descriptors.ptr<float>(static_cast<int>(features.keypoints.size())));
      features.keypoints.push_back(InImage(point));
    }
  }
  features.descriptors =
      features.descriptors.rowRange(0, static_cast<int>(features.keypoints.size())).clone();
  return features;
}

}  // namespace tutti::internal
