#include "apps/plot/plot_legend.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <utility>

#include "apps/plot/plot_picture.h"

namespace tutti {
namespace {

constexpr double kRow = 22, kSample = 34, kGap = 24, kText = 14;  // [px]

// Places on the page that a line goes through.
using Cells = std::set<std::pair<int, int>>;
constexpr double kCell = 3;  // [px]: lines so near are one

Cells CellsOf(const NamedLine& line) {
  Cells cells;
  for (std::size_t i = 0; i + 1 < line.points.size(); ++i) {
    const Eigen::Vector2d &a = line.points[i], &b = line.points[i + 1];
    if (!a.allFinite() || !b.allFinite()) continue;
    const int steps = std::clamp(static_cast<int>((b - a).norm() / kCell) + 1, 1, 2 * kPlotWidth);
    for (int k = 0; k <= steps; ++k) {
      const Eigen::Vector2d p = (a + (b - a) * k / steps) / kCell;
      cells.insert({static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))});
    }
  }
  return cells;
}

bool Covers(const Cells& upper, const Cells& lower) {
  const auto covered = std::count_if(lower.begin(), lower.end(), [&](const std::pair<int, int>& cell) {
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        if (upper.count({cell.first + dx, cell.second + dy}) > 0) return true;
      }
    }
    return false;
  });
  return 2 * covered > static_cast<std::ptrdiff_t>(lower.size());
}

// The left ends and rows of all entries, rows counted from the top.
std::vector<std::pair<double, int>> Places(const std::vector<NamedLine>& lines, double left, double right) {
  std::vector<std::pair<double, int>> places;
  double x = left;
  int row = 0;
  for (const NamedLine& line : lines) {
    const double width = kSample + 8 + TextWidth(line.name, kText) + kGap;
    if (x > left && x + width - kGap > right) {
      x = left;
      ++row;
    }
    places.emplace_back(x, row);
    x += width;
  }
  return places;
}

}  // namespace

void AddLines(std::vector<NamedLine>& lines, std::vector<PlotShape>& shapes) {
  constexpr double kMargin = 3.5, kWidest = 16;  // [px]
  std::vector<Cells> cells;
  cells.reserve(lines.size());
  for (const NamedLine& line : lines) cells.push_back(CellsOf(line));
  for (std::size_t i = lines.size(); i-- > 0;) {
    for (std::size_t j = i + 1; j < lines.size(); ++j) {
      const bool seen_through = lines[j].dashed && !lines[i].dashed;
      if (!cells[i].empty() && !seen_through && Covers(cells[j], cells[i]))
        lines[i].width = std::min(kWidest, std::max(lines[i].width, lines[j].width + kMargin));
    }
  }
  for (const NamedLine& line : lines) {
    PlotShape style;
    style.color = line.color;
    style.size = line.width;
    style.dashed = line.dashed;
    AddBrokenLine(style, line.points, shapes);
  }
}

PlotShape PlotRing(const Eigen::Vector2d& center) {
  constexpr int kCorners = 24;
  constexpr double kRadius = 7;  // [px]
  PlotShape ring;
  ring.color = kPlotInk;
  ring.size = 1.6;
  for (int k = 0; k <= kCorners; ++k) {
    const double angle = 2 * M_PI * k / kCorners;
    ring.points.push_back(center + kRadius * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return ring;
}

void AddLegend(const std::vector<NamedLine>& lines, double left, double right, double bottom,
               std::vector<PlotShape>& shapes) {
  const std::vector<std::pair<double, int>> places = Places(lines, left, right);
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const auto [x, row] = places[k];
    const double y = bottom - 8 - kRow * (places.back().second - row);
    if (lines[k].ring) {
      shapes.push_back(PlotRing({x + kSample / 2, y - 5}));
    } else {
      PlotShape sample =
          PlotLine({x, y - 5}, {x + kSample, y - 5}, lines[k].color, std::max(2.0, lines[k].width));
      sample.dashed = lines[k].dashed;
      shapes.push_back(std::move(sample));
    }
    shapes.push_back(PlotText({x + kSample + 8, y}, lines[k].name, kText));
  }
}

double LegendHeight(const std::vector<NamedLine>& lines, double left, double right) {
  return lines.empty() ? 0 : 4 + kRow * (Places(lines, left, right).back().second + 1);
}

}  // namespace tutti
