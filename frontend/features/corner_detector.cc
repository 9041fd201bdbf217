// Corners of one level of a pyramid, spread over it by a grid.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/fast_corners.h"
#include "frontend/features/features.h"

namespace tutti {
namespace {

constexpr int kCircle = 3;  // [px] FAST's radius: it finds no corner nearer to the rim

// Strongest first; equal ones by row, then by column. FAST's scores and places are whole numbers >= 0, so the
// order fits into one integer, which sorts several times faster than corners do.
using Rank = std::uint64_t;
Rank RankOf(const cv::KeyPoint& corner) {
  const std::uint64_t weakness = 0xFFFFU - static_cast<std::uint64_t>(corner.response);
  return (weakness << 40) | (static_cast<std::uint64_t>(corner.pt.y) << 20) |
         static_cast<std::uint64_t>(corner.pt.x);
}
cv::KeyPoint CornerOf(Rank rank) {
  constexpr std::uint64_t kPlace = (1U << 20) - 1;
  const auto weakness = static_cast<float>(rank >> 40);
  return {static_cast<float>(rank & kPlace), static_cast<float>((rank >> 20) & kPlace), 7.0F, -1.0F,
          65535.0F - weakness};
}

// Places are those within the image's borders.
class CornerGrid {
 public:
  CornerGrid(const cv::Mat& image, const cv::Mat& mask, const CornerOptions& options)
      : image_(image), mask_(mask), options_(options) {
    size_ = {image.cols - 2 * options.border, image.rows - 2 * options.border};
    const double area = double(size_.width) * size_.height;
    cell_ = std::max(8.0, std::sqrt(area / std::max(1, options.wanted)) * 1.2);
    columns_ = std::max(1, static_cast<int>(std::ceil(size_.width / cell_)));
    rows_ = std::max(1, static_cast<int>(std::ceil(size_.height / cell_)));
    cells_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  }

  // All corners in a part of the places that are not masked.
  std::vector<cv::KeyPoint> Detect(const cv::Rect& part, int threshold) const {
    const int rim = options_.border - kCircle;
    const cv::Rect seen(part.x + rim, part.y + rim, part.width + 2 * kCircle, part.height + 2 * kCircle);
    std::vector<cv::KeyPoint> corners = internal::FastCorners(image_(seen), threshold);
    const cv::Point2f moved(static_cast<float>(part.x - kCircle), static_cast<float>(part.y - kCircle));
    for (cv::KeyPoint& corner : corners) corner.pt += moved;
    if (!mask_.empty()) {
      const auto masked = [this](const cv::KeyPoint& corner) {
        return mask_.at<std::uint8_t>(static_cast<int>(corner.pt.y) + options_.border,
                                      static_cast<int>(corner.pt.x) + options_.border) == 0;
      };
      corners.erase(std::remove_if(corners.begin(), corners.end(), masked), corners.end());
    }
    return corners;
  }
  std::vector<cv::KeyPoint> DetectAll(int threshold) const { return Detect({{0, 0}, size_}, threshold); }

  void AddStrong(const std::vector<cv::KeyPoint>& corners) {
    for (const cv::KeyPoint& corner : corners) {
      if (corner.response < static_cast<float>(options_.threshold)) continue;
      cells_[CellOf(corner)].push_back(RankOf(corner));
    }
  }

  // To each of these cells that has no corner the strongest of these.
  void AddWeak(const std::vector<cv::KeyPoint>& corners, std::size_t first, std::size_t past) {
    std::vector<Rank> best(past - first, kNone);
    for (const cv::KeyPoint& corner : corners) {
      const std::size_t cell = CellOf(corner);
      if (cell >= first && cell < past) best[cell - first] = std::min(best[cell - first], RankOf(corner));
    }
    for (std::size_t i = first; i < past; ++i) {
      if (cells_[i].empty() && best[i - first] != kNone) cells_[i].push_back(best[i - first]);
    }
  }
  void AddWeak(const std::vector<cv::KeyPoint>& corners) { AddWeak(corners, 0, cells_.size()); }

  // What AddWeak finds among all weak corners, which are detected in empty cells alone.
  void FillEmpty() {
    for (int row = 0; row < rows_; ++row) {
      for (int first = 0; first < columns_; ++first) {
        if (!Cell(row, first).empty()) continue;
        int past = first + 1;
        while (past < columns_ && Cell(row, past).empty()) ++past;
        AddWeak(Detect(Around(row, first, past), options_.threshold_min), PlaceOf(row, first),
                PlaceOf(row, past));
        first = past;
      }
    }
  }

  std::vector<cv::KeyPoint> Strongest() {
    std::vector<Rank> chosen;
    const auto wanted = static_cast<std::size_t>(options_.wanted);
    const std::size_t rounds = Rounds();
    for (auto& cell : cells_) {
      const auto past = cell.begin() + static_cast<std::ptrdiff_t>(std::min(rounds, cell.size()));
      std::partial_sort(cell.begin(), past, cell.end());
    }
    for (std::size_t round = 0; round < rounds; ++round) {
      const std::size_t before = chosen.size();
      for (const auto& cell : cells_) {
        if (round < cell.size()) chosen.push_back(cell[round]);
      }
      if (chosen.size() <= wanted) continue;
      std::sort(chosen.begin() + static_cast<std::ptrdiff_t>(before), chosen.end());
      chosen.resize(wanted);
    }
    std::sort(chosen.begin(), chosen.end());
    std::vector<cv::KeyPoint> out;
    out.reserve(chosen.size());
    for (const Rank rank : chosen) out.push_back(CornerOf(rank));
    return out;
  }

 private:
  static constexpr Rank kNone = ~Rank{0};

  // `column` may be the one behind a row's last.
  std::size_t PlaceOf(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }
  std::size_t CellOf(const cv::KeyPoint& corner) const {
    const int c = std::min(columns_ - 1, static_cast<int>(corner.pt.x / cell_));
    const int r = std::min(rows_ - 1, static_cast<int>(corner.pt.y / cell_));
    return PlaceOf(r, c);
  }
  const std::vector<Rank>& Cell(int row, int column) const { return cells_[PlaceOf(row, column)]; }

  // The places of some cells of a row and those next to them, without which a corner does not know whether it
  // is stronger than its neighbours.
  cv::Rect Around(int row, int first, int past) const {
    const cv::Point begin(static_cast<int>(first * cell_) - 1, static_cast<int>(row * cell_) - 1);
    const cv::Point end(static_cast<int>(past * cell_) + 2, static_cast<int>((row + 1) * cell_) + 2);
    return cv::Rect(begin, end) & cv::Rect({0, 0}, size_);
  }

  // How many rounds are begun until there are as many as wanted.
  std::size_t Rounds() const {
    std::size_t count = 0, round = 0, before = 0;
    do {
      before = count;
      for (const auto& cell : cells_) count += cell.size() > round ? 1 : 0;
      ++round;
    } while (count < static_cast<std::size_t>(options_.wanted) && count > before);
    return round;
  }

  const cv::Mat& image_;
  const cv::Mat& mask_;
  const CornerOptions& options_;
  cv::Size size_;  // of the image within its borders
  double cell_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<std::vector<Rank>> cells_;
};

}  // namespace

// Few corners of an image are weak ones that are wanted, and many are weak: they are looked for where nothing
// else is. A corner has the same score whatever threshold it is looked for with, and is suppressed by
// stronger ones alone, so that it makes no difference to what comes out.
std::vector<cv::KeyPoint> DetectCorners(const cv::Mat& image, const CornerOptions& options,
                                        const cv::Mat& mask) {
  if (image.cols <= 2 * options.border || image.rows <= 2 * options.border) return {};
  CornerGrid grid(image, mask, options);
  const auto wanted = static_cast<std::size_t>(std::max(0, options.wanted));
  std::vector<cv::KeyPoint> corners = grid.DetectAll(options.threshold);
  const bool enough = corners.size() > wanted;
  if (!enough) corners = grid.DetectAll(options.threshold_min);
  if (corners.size() > wanted) {
    grid.AddStrong(corners);
    enough ? grid.FillEmpty() : grid.AddWeak(corners);
    corners = grid.Strongest();
  }
  const auto border = static_cast<float>(options.border);
  for (cv::KeyPoint& corner : corners) corner.pt += cv::Point2f(border, border);
  return corners;
}

}  // namespace tutti
