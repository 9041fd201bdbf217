#include "core/numbers.h"
#include "loopclosure/features/sift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "loopclosure/features/polar.h"

namespace tutti::internal {
namespace {

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
static_assert(kCells * kCells * kCellBins == int{kSiftValues});
static_assert(RoomForPolar(kSamples) == kSamples);

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
        Sample& sample = grid[Index(at)];
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

}  // namespace

std::vector<float> SiftOrientations(const cv::Mat& image, const cv::Point2f& at, float scale) {
  const int radius = cvRound(3.0f * kAngleSigma * scale);
  const float sigma = kAngleSigma * scale;
  const cv::Point centre(cvRound(at.x), cvRound(at.y));
  std::vector<float> falloff(Index(radius + 1));
  for (int i = 0; i <= radius; ++i) {
    falloff[Index(i)] = std::exp(-static_cast<float>(i * i) / (2 * sigma * sigma));
  }
  const int left = std::max(1, centre.x - radius);
  const int right = std::min(image.cols - 2, centre.x + radius);
  const int width = std::max(0, right - left + 1);
  const auto columns = Index(width);
  std::vector<float> dx(RoomForPolar(columns));
  std::vector<float> dy(dx.size());
  std::vector<float> length(dx.size());
  std::vector<float> angle(dx.size());
  std::array<float, kAngleBins> bins{};
  for (int y = std::max(1, centre.y - radius); y <= std::min(image.rows - 2, centre.y + radius); ++y) {
    const float* u = image.ptr<float>(y - 1) + left;
    const float* h = image.ptr<float>(y) + left;
    const float* d = image.ptr<float>(y + 1) + left;
    for (std::size_t i = 0; i < columns; ++i) {
      dx[i] = h[i + 1] - *(h + i - 1);
      dy[i] = u[i] - d[i];
    }
    Polar(dx.data(), dy.data(), columns, length.data(), angle.data());
    const float row_weight = falloff[Index(std::abs(y - centre.y))];
    for (int i = 0; i < width; ++i) {
      const auto k = Index(i);
      const int bin = cvRound(angle[k] * (kAngleBins / 360.0f)) % kAngleBins;
      bins[Index(bin)] += length[k] * row_weight * falloff[Index(std::abs(left + i - centre.x))];
    }
  }
  std::array<float, kAngleBins> smooth{};
  const auto bin = [&](int i) { return bins[Index((i + kAngleBins) % kAngleBins)]; };
  for (int i = 0; i < kAngleBins; ++i) {
    smooth[Index(i)] = (bin(i - 2) + bin(i + 2)) * (1.0f / 16) + (bin(i - 1) + bin(i + 1)) * (4.0f / 16) +
                       bin(i) * (6.0f / 16);
  }
  const float least = kAnglePeak * *std::max_element(smooth.begin(), smooth.end());
  std::vector<float> angles;
  for (int i = 0; i < kAngleBins; ++i) {
    const float here = smooth[Index(i)];
    const float before = smooth[Index((i + kAngleBins - 1) % kAngleBins)];
    const float after = smooth[Index((i + 1) % kAngleBins)];
    if (here <= before || here <= after || here < least) continue;
    const float top = static_cast<float>(i) + 0.5f * (before - after) / (before - 2 * here + after);
    angles.push_back(top * (360.0f / kAngleBins));
  }
  return angles;
}

void DescribeSift(const cv::Mat& image, const cv::Point2f& at, float scale, float angle_deg,
                  float* descriptor) {
  constexpr float kToRadians = static_cast<float>(CV_PI / 180.0);
  const float turned = 360.0f - angle_deg;
  const float cell = kCellScales * scale;
  const float cos = std::cos(turned * kToRadians) * cell;
  const float sin = std::sin(turned * kToRadians) * cell;
  std::array<float, kSamples> dx;
  std::array<float, kSamples> dy;
  std::array<float, kSamples> length;
  std::array<float, kSamples> angle;
  const std::array<Sample, kSamples>& samples = Samples();
  for (std::size_t i = 0; i < kSamples; ++i) {
    const Sample& sample = samples[i];
    const int x = cvRound(at.x + sample.x * cos + sample.y * sin);
    const int y = cvRound(at.y - sample.x * sin + sample.y * cos);
    if (x < 1 || y < 1 || x >= image.cols - 1 || y >= image.rows - 1) {
      dx[i] = dy[i] = 0;
      continue;
    }
    const float* h = image.ptr<float>(y) + x;
    dx[i] = h[1] - h[-1];
    dy[i] = *(image.ptr<float>(y - 1) + x) - *(image.ptr<float>(y + 1) + x);
  }
  Polar(dx.data(), dy.data(), kSamples, length.data(), angle.data());

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
    for (std::size_t i = 0; i < kSiftValues; ++i) squares += descriptor[i] * descriptor[i];
    return std::max(std::sqrt(squares), 1e-7f);
  };
  const float clip = kClip * norm();
  for (std::size_t i = 0; i < kSiftValues; ++i) descriptor[i] = std::min(descriptor[i], clip);
  const float longer = kLength / norm();
  for (std::size_t i = 0; i < kSiftValues; ++i) {
    descriptor[i] = static_cast<float>(cv::saturate_cast<std::uint8_t>(descriptor[i] * longer));
  }
}

}  // namespace tutti::internal
