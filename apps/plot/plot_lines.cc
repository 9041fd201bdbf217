#include "apps/plot/plot_lines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <set>

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

constexpr int kColors = 64;  // steps that are told apart on a line

int StepOf(double value, double low, double high) {
  const double share = high > low ? (value - low) / (high - low) : 0;
  return std::clamp(static_cast<int>(share * kColors), 0, kColors - 1);
}

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

}  // namespace

void AddLines(std::vector<NamedLine>& lines, std::vector<PlotShape>& shapes) {
  constexpr double kMargin = 3.5, kWidest = 16;  // [px]
  std::vector<Cells> cells;
  for (const NamedLine& line : lines) cells.push_back(CellsOf(line));
  for (std::size_t i = lines.size(); i-- > 0;) {
    for (std::size_t j = i + 1; j < lines.size(); ++j) {
      const bool seen_through = lines[j].dashed && !lines[i].dashed;
      if (!cells[i].empty() && !seen_through && Covers(cells[j], cells[i]))
        lines[i].width = std::min(kWidest, std::max(lines[i].width, lines[j].width + kMargin));
    }
  }
  for (const NamedLine& line : lines) {
    AddBrokenLine({PlotShape::Kind::kLine, {}, line.color, line.width, line.dashed}, line.points, shapes);
  }
}

PlotShape PlotRing(const Eigen::Vector2d& center) {
  constexpr int kCorners = 24;
  constexpr double kRadius = 7;  // [px]
  PlotShape ring{PlotShape::Kind::kLine, {}, kPlotInk, 1.6};
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

std::string HeatColor(double share) {
  // Between dark blue and orange of matplotlib's plasma (CC0); its yellow is not seen on white.
  static constexpr std::array<std::array<double, 3>, 6> kStops = {
      {{13, 8, 135}, {91, 2, 163}, {154, 23, 155}, {203, 70, 120}, {235, 120, 82}, {251, 179, 47}}};
  const double at = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const std::size_t k = std::min<std::size_t>(static_cast<std::size_t>(at), kStops.size() - 2);
  const double part = at - static_cast<double>(k);
  std::array<int, 3> rgb{};
  for (std::size_t c = 0; c < 3; ++c)
    rgb[c] = static_cast<int>(std::lround((1 - part) * kStops[k][c] + part * kStops[k + 1][c]));
  char text[8];
  std::snprintf(text, sizeof text, "#%02x%02x%02x", static_cast<unsigned>(rgb[0]) & 0xffu,
                static_cast<unsigned>(rgb[1]) & 0xffu, static_cast<unsigned>(rgb[2]) & 0xffu);
  return text;
}

void AddHeatLine(const std::vector<Eigen::Vector2d>& points, const std::vector<double>& values, double low,
                 double high, double width, std::vector<PlotShape>& shapes) {
  PlotShape line{PlotShape::Kind::kLine, {}, "", width};
  int step = -1;
  const auto end_line = [&] {
    if (line.points.size() > 1) shapes.push_back(line);
    line.points.clear();
    step = -1;
  };
  for (std::size_t k = 1; k < points.size(); ++k) {
    const double value = 0.5 * (values[k - 1] + values[k]);
    if (!std::isfinite(value) || !points[k - 1].allFinite() || !points[k].allFinite()) {
      end_line();
      continue;
    }
    if (StepOf(value, low, high) != step) {
      end_line();
      step = StepOf(value, low, high);
      line.color = HeatColor((step + 0.5) / kColors);
      line.points.push_back(points[k - 1]);
    }
    line.points.push_back(points[k]);
  }
  end_line();
}

void AddHeatBar(const PlotAxes& axes, const std::string& name, double low, double high,
                std::vector<PlotShape>& shapes) {
  constexpr double kGap = 22, kWidth = 16;  // [px]
  const double left = axes.bottom_right.x() + kGap, right = left + kWidth;
  const double top = axes.top_left.y(), bottom = axes.bottom_right.y();
  for (int k = 0; k < kColors; ++k) {
    const double from = bottom - (bottom - top) * k / kColors,
                 to = bottom - (bottom - top) * (k + 1) / kColors;
    shapes.push_back(
        PlotBox({left, k + 1 < kColors ? to - 1 : to}, {right, from}, HeatColor((k + 0.5) / kColors)));
  }
  shapes.push_back(PlotText({right + 8, bottom}, Number(low), 14));
  if (high > low) {
    shapes.push_back(PlotText({right + 8, 0.5 * (top + bottom) + 5}, Number(0.5 * (low + high)), 14));
    shapes.push_back(PlotText({right + 8, top + 10}, Number(high), 14));
  }
  PlotShape text = PlotText({kPlotWidth - 8.0, 0.5 * (top + bottom)}, name, 14, PlotShape::Anchor::kMiddle);
  text.vertical = true;
  shapes.push_back(text);
}

}  // namespace tutti
