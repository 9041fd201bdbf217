// A plot as a list of simple shapes, so that SVG and PNG show the same picture.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "tutti/pipeline/plot.h"

namespace tutti {

constexpr int kPlotWidth = 1000;  // [px]
constexpr int kPlotHeight = 760;  // [px]

/// A polyline, a filled disc (one point, radius) or a text (one point).
struct PlotShape {
  enum class Kind { kLine, kDisc, kText } kind = Kind::kLine;
  std::vector<Eigen::Vector2d> points;  ///< [px], y down
  std::string color = "#000000";
  double size = 1;  ///< line width, radius or text height [px]
  bool dashed = false;
  std::string text;
  enum class Anchor { kStart, kMiddle, kEnd } anchor = Anchor::kStart;
  bool vertical = false;  ///< text that reads upwards
};

/// Axes with ticks, grid, lines, loop edges, legend.
std::vector<PlotShape> LayOut(const TrajectoryPlot& plot);

}  // namespace tutti
