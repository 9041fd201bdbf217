#include "loopclosure/features/surf_hessian.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/inner_loops.h"
#include "core/numbers.h"

namespace tutti::internal {
namespace {

using Sum = std::int32_t;

// Where a row of sums is read: at `offset` pixels from each of the places of a layer.
class Reader {
 public:
  // Reads sums as they lie in memory.
  Reader(int first, int step) : first_(first), step_(step) {}
  // Reads sums that are split into `odd` of even columns and those of odd ones: each second place then lies
  // beside the one before.
  static Reader OfSplit(int first, int odd) {
    Reader reader(first, 1);
    reader.odd_ = odd;
    return reader;
  }

  const Sum* At(const Sum* row, int offset) const {
    const int column = first_ + offset;
    if (odd_ == 0) return row + column;
    return row + (column & 1) * odd_ + (column >> 1);
  }
  int step() const { return step_; }

 private:
  int first_;
  int step_;
  int odd_ = 0;
};

// A box of sums: of each place.
struct Corners {
  const Sum *above_left, *above_right, *below_left, *below_right;
};

Corners Box(const Reader& at, const Sum* above, const Sum* below, int left, int right) {
  return {at.At(above, left), at.At(above, right), at.At(below, left), at.At(below, right)};
}

void CheckBox(const Corners& box, int step, int count) {
  if (count <= 0) return;
  for (const Sum* corner : {box.above_left, box.above_right, box.below_left, box.below_right})
    CheckReadable(corner, Index(count - 1) * Index(step) + 1);
}

TUTTI_CHECKED_AS_A_WHOLE inline Sum Inside(const Corners& box, int i) {
  return (box.below_right[i] - box.below_left[i]) - (box.above_right[i] - box.above_left[i]);
}

// The outer box less three times the inner one, for `count` places.
TUTTI_CLONES("avx2")
TUTTI_CHECKED_AS_A_WHOLE void SecondDerivative(const Corners& outer, const Corners& inner, int step,
                                               int count, Sum* out) {
  CheckBox(outer, step, count);
  CheckBox(inner, step, count);
  CheckWritable(out, Index(count));
  const Corners o = outer;
  const Corners n = inner;
  if (step == 1) {
    for (int i = 0; i < count; ++i) out[i] = Inside(o, i) - 3 * Inside(n, i);
    return;
  }
  for (int i = 0; i < count; ++i) out[i] = Inside(o, i * step) - 3 * Inside(n, i * step);
}

// The boxes of one diagonal less those of the other. Lines of sums, from above to below.
TUTTI_CLONES("avx2")
TUTTI_CHECKED_AS_A_WHOLE void MixedDerivative(const Corners& above_right, const Corners& below_left,
                                              const Corners& above_left, const Corners& below_right, int step,
                                              int count, Sum* out) {
  for (const Corners* box : {&above_right, &below_left, &above_left, &below_right})
    CheckBox(*box, step, count);
  CheckWritable(out, Index(count));
  const Corners a = above_right;
  const Corners b = below_left;
  const Corners c = above_left;
  const Corners d = below_right;
  if (step == 1) {
    for (int i = 0; i < count; ++i) out[i] = (Inside(b, i) + Inside(a, i)) - (Inside(c, i) + Inside(d, i));
    return;
  }
  for (int i = 0; i < count; ++i) {
    const int k = i * step;
    out[i] = (Inside(b, k) + Inside(a, k)) - (Inside(c, k) + Inside(d, k));
  }
}

TUTTI_CLONES("avx2")
void Determinants(const Sum* xx, const Sum* yy, const Sum* xy, double area, int count, double* out) {
  for (int i = 0; i < count; ++i) {
    const double dxx = xx[i] * area;
    const double dyy = yy[i] * area;
    const double dxy = xy[i] * area;
    const double determinant = dxx * dyy - 0.81 * dxy * dxy;
    out[i] = std::copysign(determinant > 0.0 ? determinant : 0.0, dxx + dyy);
  }
}

// Even columns of each row, then the odd ones.
void Split(const SurfIntegral& image, cv::Mat& split) {
  const int columns = static_cast<int>(image.nc()) + 1;
  const int even = (columns + 1) / 2;
  split.create(static_cast<int>(image.nr()) + 1, columns, CV_32S);
  for (int r = 0; r < split.rows; ++r) {
    const Sum* from = image.Row(r);
    Sum* to = split.ptr<Sum>(r);
    for (int c = 0; c < columns / 2; ++c) {
      to[c] = from[2 * c];
      to[even + c] = from[2 * c + 1];
    }
    if (columns % 2 != 0) to[even - 1] = from[columns - 1];
  }
}

}  // namespace

void SurfHessian::Compute(const SurfIntegral& image, int octaves) {
  octaves_ = octaves;
  layers_.resize(Index(octaves) * kIntervals);
  const auto columns = static_cast<std::size_t>(image.nc());
  xx_.resize(columns);
  yy_.resize(columns);
  xy_.resize(columns);
  Split(image, split_);
  for (int o = 0; o < octaves; ++o) {
    for (int i = 0; i < kIntervals; ++i) {
      // Boxes of an octave's interval i are as large as those of 2 i + 1 of the one before.
      if (o > 0 && 2 * i + 1 < kIntervals) {
        CopyFromFiner(o, i, 2 * i + 1);
      } else {
        Fill(image, o, i);
      }
    }
  }
}

void SurfHessian::CopyFromFiner(int octave, int interval, int finer_interval) {
  const cv::Mat& finer = Layer(octave - 1, finer_interval);
  cv::Mat& layer = At(octave, interval);
  layer.create(finer.rows / 2, finer.cols / 2, CV_64F);
  const int border = Border(interval);
  for (int r = border; r < layer.rows; ++r) {
    const double* from = finer.ptr<double>(2 * r);
    double* to = layer.ptr<double>(r);
    for (int c = border; c < layer.cols; ++c) to[c] = from[2 * c];
  }
}

void SurfHessian::Fill(const SurfIntegral& image, int octave, int interval) {
  const int step = Step(octave);
  const int border = Border(interval) * step;
  const int lobe = (2 << octave) * (interval + 1) + 1;
  const int half = lobe / 2;
  const int wide = 3 * lobe / 2;
  const double area = 1.0 / ((3.0 * lobe) * (3.0 * lobe));
  const int rows = static_cast<int>(image.nr());
  const int cols = static_cast<int>(image.nc());
  cv::Mat& layer = layers_[Index(octave) * kIntervals + Index(interval)];
  layer.create(rows / step, cols / step, CV_64F);
  // Places x = border, border + step, ... < cols - border that the layer has.
  const int past = std::min((cols - border + step - 1) / step, layer.cols);
  const int count = past - border / step;
  if (count <= 0) return;
  const bool split = step == 2;
  const Reader at = split ? Reader::OfSplit(border, (cols + 2) / 2) : Reader(border, step);
  const auto line = [&](int y) { return split ? split_.ptr<Sum>(y) : image.Row(y); };
  for (int y = border; y < rows - border && y / step < layer.rows; y += step) {
    const Sum* above = line(y - lobe);
    const Sum* here = line(y);
    const Sum* next = line(y + 1);
    const Sum* below = line(y + lobe + 1);
    const Sum* top = line(y - lobe + 1);
    const Sum* bottom = line(y + lobe);
    SecondDerivative(Box(at, top, bottom, -wide, wide + 1), Box(at, top, bottom, -half, half + 1), at.step(),
                     count, xx_.data());
    SecondDerivative(Box(at, line(y - wide), line(y + wide + 1), 1 - lobe, lobe),
                     Box(at, line(y - half), line(y + half + 1), 1 - lobe, lobe), at.step(), count,
                     yy_.data());
    MixedDerivative(Box(at, above, here, 1, lobe + 1), Box(at, next, below, -lobe, 0),
                    Box(at, above, here, -lobe, 0), Box(at, next, below, 1, lobe + 1), at.step(), count,
                    xy_.data());
    Determinants(xx_.data(), yy_.data(), xy_.data(), area, count,
                 layer.ptr<double>(y / step) + border / step);
  }
}

TUTTI_CLONES("avx2")
TUTTI_CHECKED_AS_A_WHOLE void FindMaxima(const double* h, const double* u, const double* d,
                                         const double* finer, const double* coarser, int begin, int past,
                                         double least, std::uint8_t* found) {
  if (past <= begin) return;
  const auto count = Index(past - begin);
  CheckReadable(h + begin - 1, count + 2);
  for (const double* line : {u, d, finer, coarser}) CheckReadable(line + begin, count);
  CheckWritable(found + begin, count);
  for (int c = begin; c < past; ++c) {
    const double value = std::abs(h[c]);
    found[c] = static_cast<std::uint8_t>((value >= least) & (std::abs(h[c - 1]) <= value) &
                                         (std::abs(h[c + 1]) <= value) & (std::abs(u[c]) <= value) &
                                         (std::abs(d[c]) <= value) & (std::abs(finer[c]) <= value) &
                                         (std::abs(coarser[c]) <= value));
  }
}

}  // namespace tutti::internal
