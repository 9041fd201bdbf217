// Values as colours: lines, and the bar that explains them.
#pragma once

#include <string>
#include <vector>

#include "apps/plot/plot_shapes.h"

namespace tutti {

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
