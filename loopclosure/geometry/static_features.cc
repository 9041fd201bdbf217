#include "loopclosure/geometry/static_features.h"

#include <algorithm>
#include <array>

#include "loopclosure/geometry/evidence.h"

namespace tutti::internal {
namespace {

using Cells = std::array<int, kGridColumns * kGridRows>;

Cells CountFeatures(const View& view) {
  Cells cells{};
  const auto count = [&](const View::Set& set) {
    for (const cv::Point2f& p : set.pixels) ++cells[static_cast<std::size_t>(GridCell(p, view.size))];
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
        near[static_cast<std::size_t>(at)] = true;
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
