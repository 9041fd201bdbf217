// What names the lines of a plot, and keeps those visible that others lie on.
#pragma once

#include <string>
#include <vector>

#include "apps/plot/plot_shapes.h"

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

}  // namespace tutti
