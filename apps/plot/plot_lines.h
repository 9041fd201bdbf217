// How a plot draws lines: so that those are seen that others lie on, with a legend; or in colours that are
// values, with the bar that explains them.
#pragma once

#include <string>
#include <vector>

#include "apps/plot/plot.h"

namespace tutti {

/// A line on the page with its name.
struct NamedLine {
  std::string name;
  std::vector<Eigen::Vector2d> points = {};  ///< [px]; one that is not finite interrupts it
  std::string color = "#000000";             ///< #rrggbb
  double width = 2;                          ///< [px]
  bool dashed = false;
  bool ring = false;  ///< no line: the name is that of rings
};

/// The line and the name of a curve, without its points.
inline NamedLine LineOf(const PlotCurve& curve) {
  return {curve.name, {}, curve.color, curve.width, curve.dashed};
}

/// Draws the lines, the first at the bottom. Where one is mostly covered by others, it gets wider than these,
/// so that its colour is seen on both sides of them.
void AddLines(std::vector<NamedLine>& lines, std::vector<PlotShape>& shapes);

/// A ring around a place [px].
PlotShape PlotRing(const Eigen::Vector2d& center);

/// Names beside samples of their lines, in rows from `left` to `right`, the last one above `bottom` [px].
void AddLegend(const std::vector<NamedLine>& lines, double left, double right, double bottom,
               std::vector<PlotShape>& shapes);
/// How much room above `bottom` that takes [px].
double LegendHeight(const std::vector<NamedLine>& lines, double left, double right);

/// #rrggbb for 0 (dark blue) to 1 (orange); brightness grows evenly, so that colour-blind people and grey
/// prints keep the order.
std::string HeatColor(double share);

/// A polyline of points on the page, each part in the colour of its ends' mean value; a point or a value that
/// is not finite interrupts it. `low`, `high`: values of the first and the last colour.
void AddHeatLine(const std::vector<Eigen::Vector2d>& points, const std::vector<double>& values, double low,
                 double high, double width, std::vector<PlotShape>& shapes);

constexpr double kHeatBarRoom = 110;  ///< on the right of the axes' box, for AddHeatBar [px]

/// Colours with the values at their ends and in the middle, on the right of the axes' box.
void AddHeatBar(const PlotAxes& axes, const std::string& name, double low, double high,
                std::vector<PlotShape>& shapes);

}  // namespace tutti
