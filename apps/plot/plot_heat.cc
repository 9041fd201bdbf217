#include "apps/plot/plot_heat.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace tutti {
namespace {

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
  PlotShape line;
  line.size = width;
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
    shapes.push_back(PlotBox({left, to}, {right, from}, HeatColor((k + 0.5) / kColors)));
  }
  shapes.push_back(PlotText({right + 8, bottom}, Number(low), 14));
  if (high > low) {
    shapes.push_back(PlotText({right + 8, 0.5 * (top + bottom) + 5}, Number(0.5 * (low + high)), 14));
    shapes.push_back(PlotText({right + 8, top + 10}, Number(high), 14));
  }
  PlotShape text = PlotText({right + kHeatBarRoom - kGap - kWidth - 8, 0.5 * (top + bottom)}, name, 14,
                            PlotShape::Anchor::kMiddle);
  text.vertical = true;
  shapes.push_back(text);
}

}  // namespace tutti
