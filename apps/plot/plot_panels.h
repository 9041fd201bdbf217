// Curves one below the other over a common axis: x, y and z over time.
#pragma once

#include <string>
#include <vector>

#include "apps/plot/plot.h"

namespace tutti {

struct PlotPanel {
  std::string y_name;
  std::vector<PlotCurve> curves;  ///< a point that is not finite interrupts the line
};

/// The legend is that of the first panel's curves.
struct PanelPlot {
  std::string title, x_name;
  std::vector<PlotPanel> panels;  ///< at least one
};

/// The shapes of a plot on a page of kPlotWidth x kPlotHeight.
std::vector<PlotShape> LayOut(const PanelPlot& plot);

}  // namespace tutti
