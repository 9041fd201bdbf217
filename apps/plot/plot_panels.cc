#include "apps/plot/plot_panels.h"

#include <algorithm>
#include <limits>

#include "apps/plot/plot_picture.h"

namespace tutti {
namespace {

constexpr double kPanelGap = 30, kLegendHeight = 24;  // [px]

/// Low and high of one coordinate of all curves, with a little room.
Eigen::Vector2d RangeOf(const std::vector<const PlotCurve*>& curves, int axis, double room) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Eigen::Vector2d range(kInfinity, -kInfinity);
  for (const PlotCurve* curve : curves) {
    for (const Eigen::Vector2d& p : curve->points) {
      if (!p.allFinite()) continue;
      range = {std::min(range[0], p[axis]), std::max(range[1], p[axis])};
    }
  }
  if (!(range[0] <= range[1])) return {0, 1};
  const double size = range[1] - range[0];
  const double margin = size > 1e-12 * range.cwiseAbs().maxCoeff() ? room * size : 0.5;
  return {range[0] - margin, range[1] + margin};
}

std::vector<const PlotCurve*> CurvesOf(const PlotPanel& panel) {
  std::vector<const PlotCurve*> out;
  for (const PlotCurve& curve : panel.curves) out.push_back(&curve);
  return out;
}

void AddCurve(const PlotCurve& curve, const PlotAxes& axes, std::vector<PlotShape>& shapes) {
  PlotShape line;
  line.color = curve.color;
  line.size = curve.width;
  line.dashed = curve.dashed;
  std::vector<Eigen::Vector2d> points;
  points.reserve(curve.points.size());
  for (const Eigen::Vector2d& p : curve.points) points.push_back(axes.Page(p));
  AddBrokenLine(line, points, shapes);
}

/// In one line, cut off at the right.
void AddLegendLine(const std::vector<PlotCurve>& curves, const PlotAxes& axes,
                   std::vector<PlotShape>& shapes) {
  double x = axes.top_left.x();
  const double y = axes.top_left.y() - 8;
  for (const PlotCurve& curve : curves) {
    const double width = 42 + TextWidth(curve.name, 14) + 24;
    if (x + width > axes.bottom_right.x() && x > axes.top_left.x()) {
      shapes.push_back(PlotText({x, y}, "...", 14));
      return;
    }
    PlotShape line = PlotLine({x, y - 5}, {x + 34, y - 5}, curve.color, std::max(2.0, curve.width));
    line.dashed = curve.dashed;
    shapes.push_back(line);
    shapes.push_back(PlotText({x + 42, y}, curve.name, 14));
    x += width;
  }
}

}  // namespace

std::vector<PlotShape> LayOut(const PanelPlot& plot) {
  std::vector<const PlotCurve*> all;
  for (const PlotPanel& panel : plot.panels) {
    const std::vector<const PlotCurve*> curves = CurvesOf(panel);
    all.insert(all.end(), curves.begin(), curves.end());
  }
  const Eigen::Vector2d x = RangeOf(all, 0, 0);
  const PlotAxes page;
  const double top = page.top_left.y() + kLegendHeight, count = static_cast<double>(plot.panels.size());
  const double height = (page.bottom_right.y() - top - kPanelGap * (count - 1)) / count;
  std::vector<PlotShape> shapes;
  for (std::size_t k = 0; k < plot.panels.size(); ++k) {
    PlotAxes axes;
    axes.top_left.y() = top + static_cast<double>(k) * (height + kPanelGap);
    axes.bottom_right.y() = axes.top_left.y() + height;
    const Eigen::Vector2d y = RangeOf(CurvesOf(plot.panels[k]), 1, 0.06);
    axes.low = {x[0], y[0]};
    axes.high = {x[1], y[1]};
    axes.y_ticks = std::max(3.0, 12 / count);
    axes.y_name = plot.panels[k].y_name;
    if (k + 1 == plot.panels.size()) axes.x_name = plot.x_name;
    AddAxes(axes, shapes);
    for (const PlotCurve& curve : plot.panels[k].curves) AddCurve(curve, axes, shapes);
    if (k > 0) continue;
    AddLegendLine(plot.panels[k].curves, axes, shapes);
    const double middle = 0.5 * (axes.top_left.x() + axes.bottom_right.x());
    shapes.push_back(PlotText({middle, page.top_left.y() - 20}, plot.title, 18, PlotShape::Anchor::kMiddle));
  }
  return shapes;
}

}  // namespace tutti
