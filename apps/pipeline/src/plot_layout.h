// Plots as lists of simple shapes.
#pragma once

#include <vector>

#include "tutti/pipeline/plot.h"
#include "tutti/pipeline/plot_shapes.h"

namespace tutti {

/// Axes with ticks, grid, lines, loop edges, legend.
std::vector<PlotShape> LayOut(const TrajectoryPlot& plot);

/// Axes, curves, marks, legend with notes at the lower left.
std::vector<PlotShape> LayOut(const CurvePlot& plot);

}  // namespace tutti
