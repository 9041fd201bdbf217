// Plots of trajectories seen from above, and of curves over two axes, as SVG and as PNG.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "apps/plot/plot_shapes.h"

namespace tutti {

/// One line of the plot.
struct PlotSeries {
  std::string name;                     ///< for the legend
  std::vector<Eigen::Vector3d> points;  ///< [m]; one that is not finite interrupts the line
  std::string color = "#000000";        ///< #rrggbb
  double width = 1.5;                   ///< [px]
  bool dashed = false;
  std::vector<double> values = {};  ///< one for each point: the line is coloured by them, `color` is not used
};

/// What to draw. The two axes with the largest extent (of the first series, then of all) span the plane.
struct TrajectoryPlot {
  std::string title;
  std::string unit = "m";  ///< of both axes
  std::vector<PlotSeries> series;
  std::string values_name;  ///< of all `values`, at the bar of colours
  std::string edges_name = "loops";
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> edges;  ///< loop edges
  std::string edges_color = "#009e73";
  std::string marks_name;
  std::vector<Eigen::Vector3d> marks;  ///< places with a ring around them
};

/// One curve over two axes.
struct PlotCurve {
  std::string name;                     ///< for the legend
  std::vector<Eigen::Vector2d> points;  ///< values
  std::string color = "#000000";        ///< #rrggbb
  double width = 2;                     ///< [px]
  bool dashed = false;
  std::vector<Eigen::Vector2d> marks;  ///< points of the curve that get a disc
};

/// Curves over two axes, such as precision over recall.
struct CurvePlot {
  std::string title, x_name, y_name;
  std::vector<PlotCurve> curves;
  std::vector<std::string> notes;  ///< lines below the legend
  bool fit = false;  ///< axes from 0 to what the curves reach, legend on top; else from 0 to 1, legend below
};

/// Colour of the k-th of several series; Okabe and Ito's palette, told apart by colour-blind people too. From
/// the 7th series on colours repeat; draw those dashed.
const char* PlotPalette(std::size_t k);
constexpr std::size_t kPlotPaletteSize = 6;
/// Of the k-th recording that a map held before, in every picture and page (view.js, base.js); none is that
/// of a run's own trajectory.
const char* SessionColor(std::size_t k);

/// The shapes of a plot on a page of kPlotWidth x kPlotHeight. Points that are not finite are left out.
std::vector<PlotShape> LayOut(const TrajectoryPlot& plot);
std::vector<PlotShape> LayOut(const CurvePlot& plot);

/// Writes the plot. Throws InputError if the file can't be written in full. Points that are not finite are
/// left out.
void WriteSvg(const std::filesystem::path& file, const TrajectoryPlot& plot);
void WritePng(const std::filesystem::path& file, const TrajectoryPlot& plot);
void WriteSvg(const std::filesystem::path& file, const CurvePlot& plot);
void WritePng(const std::filesystem::path& file, const CurvePlot& plot);

}  // namespace tutti
