#include "loopclosure/geometry/evidence.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/dense_solvers.h"
#include "core/numbers.h"

namespace tutti::internal {
namespace {

struct ModelTraits {
  int sample;
  double models;  // per sample, at most
};

ModelTraits TraitsOf(FitModel model) {
  switch (model) {
    case FitModel::kFundamental:
      return {7, 3};
    case FitModel::kEssential:
      return {5, 10};
    case FitModel::kPnp:
      break;
  }
  return {3, 4};
}

// log10 of the number of ways to choose k of n.
double LogChoose(int n, int k) {
  double sum = 0;
  for (int i = 1; i <= std::min(k, n - k); ++i) sum += std::log10(static_cast<double>(n - i + 1) / i);
  return sum;
}

}  // namespace

ChanceFit FitByChance(FitModel model, int matches, int inliers, double threshold_px, const cv::Size& image) {
  const ModelTraits traits = TraitsOf(model);
  ChanceFit chance;
  if (matches < 1 || image.empty()) return chance;
  const double area = static_cast<double>(image.width) * image.height;
  const double diagonal = std::hypot(image.width, image.height);
  const double alpha = std::min(1.0, 2 * threshold_px * diagonal / area);
  const int free = std::max(0, matches - traits.sample);
  chance.expected = std::min(matches, traits.sample) + alpha * free;
  if (inliers <= traits.sample || free == 0) return chance;
  chance.log_nfa = std::log10(traits.models * free) + LogChoose(matches, inliers) +
                   LogChoose(inliers, traits.sample) + (inliers - traits.sample) * std::log10(alpha);
  return chance;
}

int GridCell(const cv::Point2f& pixel, const cv::Size& image) {
  const auto along = [](float x, int size, int cells) {
    return std::clamp(static_cast<int>(std::floor(x * static_cast<float>(cells) / static_cast<float>(size))),
                      0, cells - 1);
  };
  return along(pixel.y, image.height, kGridRows) * kGridColumns + along(pixel.x, image.width, kGridColumns);
}

int OccupiedCells(const std::vector<cv::Point2f>& pixels, const cv::Size& image) {
  if (image.empty()) return 0;
  std::array<bool, kGridColumns * kGridRows> occupied{};
  for (const cv::Point2f& p : pixels) occupied[Index(GridCell(p, image))] = true;
  return static_cast<int>(std::count(occupied.begin(), occupied.end(), true));
}

double MotionSpread(const std::vector<cv::Point2f>& first, const std::vector<cv::Point2f>& second,
                    const cv::Size& image) {
  if (first.empty() || first.size() != second.size() || image.empty()) return 0;
  const double n = static_cast<double>(first.size());
  double x = 0, y = 0, squares = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const cv::Point2d moved = cv::Point2d(second[i]) - cv::Point2d(first[i]);
    x += moved.x / n;
    y += moved.y / n;
    squares += moved.dot(moved) / n;
  }
  return std::sqrt(std::max(0.0, squares - x * x - y * y)) / std::hypot(image.width, image.height);
}

double NarrowestSpread(const std::vector<cv::Point2f>& pixels, const cv::Size& image) {
  if (pixels.empty() || image.empty()) return 0.0;
  const double n = static_cast<double>(pixels.size());
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> scaled;
  for (const cv::Point2f& p : pixels) {
    scaled.emplace_back(p.x / image.width, p.y / image.height);
    mean += scaled.back() / n;
  }
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& p : scaled) covariance += (p - mean) * (p - mean).transpose() / n;
  return std::sqrt(std::max(0.0, SymmetricEigen(covariance).values(0)));
}

// What a motion is known by grows with number times spread squared.
double SpreadNeeded(double spread, int least, int inliers) {
  constexpr double kLeastShare = 0.6;  // of the spread, however many the inliers
  const double abundance = std::sqrt(1.5 * least / static_cast<double>(inliers));
  return spread * std::clamp(abundance, kLeastShare, 1.0);
}

namespace {

using Cells = std::array<int, kGridColumns * kGridRows>;

Cells CountFeatures(const View& view) {
  Cells cells{};
  const auto count = [&](const View::Set& set) {
    for (const cv::Point2f& p : set.pixels) ++cells[Index(GridCell(p, view.size))];
  };
  for (const View::Set& set : view.members) count(set);
  count(view.caller);
  return cells;
}

}  // namespace

bool StaysAtItsPixel(const VerifiedMatch& match, double static_px) {
  const cv::Point2f moved = match.query - match.candidate;
  return moved.dot(moved) < static_px * static_px;
}

double ShareApart(const std::vector<VerifiedMatch>& matches, const View& query, const View& candidate) {
  if (query.size.empty() || candidate.size.empty()) return 0;
  std::array<bool, kGridColumns * kGridRows> near{};
  for (const VerifiedMatch& match : matches) {
    const int cell = GridCell(match.query, query.size);
    const int row = cell / kGridColumns, column = cell % kGridColumns;
    for (int r = std::max(0, row - 1); r <= std::min(kGridRows - 1, row + 1); ++r) {
      for (int c = std::max(0, column - 1); c <= std::min(kGridColumns - 1, column + 1); ++c) {
        const int at = r * kGridColumns + c;
        near[Index(at)] = true;
      }
    }
  }
  const Cells in_query = CountFeatures(query);
  const Cells in_candidate = CountFeatures(candidate);
  int all = 0, apart = 0;
  for (std::size_t i = 0; i < near.size(); ++i) {
    const int features = std::min(in_query[i], in_candidate[i]);
    all += features;
    if (!near[i]) apart += features;
  }
  return all > 0 ? static_cast<double>(apart) / all : 0.0;
}

}  // namespace tutti::internal
