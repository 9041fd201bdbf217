#include <algorithm>
#include <limits>

#include "apps/plot/plot_lines.h"

namespace tutti {
namespace {

constexpr double kPanelGap = 30;  // [px]

/// Low and high of one coordinate of all curves of some panels, with a little room.
Eigen::Vector2d RangeOf(const std::vector<PlotPanel>& panels, int axis, double room) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Eigen::Vector2d range(kInfinity, -kInfinity);
  for (const PlotPanel& panel : panels) {
    for (const PlotCurve& curve : panel.curves) {
      for (const Eigen::Vector2d& p : curve.points) {
        if (p.allFinite()) range = {std::min(range[0], p[axis]), std::max(range[1], p[axis])};
      }
    }
  }
  if (!(range[0] <= range[1])) return {0, 1};
  const double size = range[1] - range[0];
  const double margin = size > 1e-12 * range.cwiseAbs().maxCoeff() ? room * size : 0.5;
  return {range[0] - margin, range[1] + margin};
}

}  // namespace

std::vector<PlotShape> LayOut(const PanelPlot& plot) {
  const Eigen::Vector2d x = RangeOf(plot.panels, 0, 0);
  const PlotAxes page;
  std::vector<NamedLine> names;
  if (!plot.panels.empty()) {
    for (const PlotCurve& curve : plot.panels.front().curves) names.push_back(LineOf(curve));
  }
  const double left = page.top_left.x(), right = page.bottom_right.x();
  const double top = page.top_left.y() + LegendHeight(names, left, right),
               count = static_cast<double>(plot.panels.size());
  const double height = (page.bottom_right.y() - top - kPanelGap * (count - 1)) / count;
  std::vector<PlotShape> shapes;
  for (std::size_t k = 0; k < plot.panels.size(); ++k) {
    PlotAxes axes;
    axes.top_left.y() = top + static_cast<double>(k) * (height + kPanelGap);
    axes.bottom_right.y() = axes.top_left.y() + height;
    const Eigen::Vector2d y = RangeOf({plot.panels[k]}, 1, 0.06);
    axes.low = {x[0], y[0]};
    axes.high = {x[1], y[1]};
    axes.y_ticks = std::max(3.0, 12 / count);
    axes.y_name = plot.panels[k].y_name;
    if (k + 1 == plot.panels.size()) axes.x_name = plot.x_name;
    AddAxes(axes, shapes);
    std::vector<NamedLine> lines;
    for (const PlotCurve& curve : plot.panels[k].curves) {
      lines.push_back(LineOf(curve));
      for (const Eigen::Vector2d& p : curve.points) lines.back().points.push_back(axes.Page(p));
    }
    AddLines(lines, shapes);
    if (k == 0) names = lines;
  }
  AddLegend(names, left, right, top, shapes);
  shapes.push_back(
      PlotText({0.5 * (left + right), page.top_left.y() - 20}, plot.title, 18, PlotShape::Anchor::kMiddle));
  return shapes;
}

}  // namespace tutti
