// Plots of trajectories seen from above, of curves over two axes, and of distributions.
#pragma once

#include <utility>

#include "apps/plot/plot_picture.h"

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

/// One of several plots below each other.
struct PlotPanel {
  std::string y_name;
  std::vector<PlotCurve> curves;  ///< a point that is not finite interrupts the line
};

/// Curves over a common axis: x, y and z over time. The legend is that of the first panel's curves.
struct PanelPlot {
  std::string title, x_name;
  std::vector<PlotPanel> panels;  ///< at least one
};

/// The errors of an estimate.
struct PlotDistribution {
  std::string name;
  std::vector<double> values;
  std::string color = "#000000";  ///< #rrggbb
};

/// Box plots and violins.
struct DistributionPlot {
  std::string title, y_name;
  std::vector<PlotDistribution> distributions;
  bool violins = false;  ///< the density around each box
};

/// The five numbers of a box plot (Tukey, 1977).
struct BoxNumbers {
  double low = 0, high = 0;  ///< whiskers: the outermost values within 1.5 box heights of the box
  double first_quartile = 0, median = 0, third_quartile = 0;
};
/// Quartiles interpolate linearly between values, as NumPy's. Values that are not finite are left out; of
/// none all numbers are 0.
BoxNumbers BoxOf(std::vector<double> values);

/// Gaussian kernel density (Scott's bandwidth, as SciPy's) at `count` evenly spaced values from the least to
/// the largest; (value, density). Of fewer than two distinct values nothing.
std::vector<Eigen::Vector2d> DensityOf(const std::vector<double>& values, std::size_t count);

/// Colour of the k-th of several series; Okabe and Ito's palette, told apart by colour-blind people too. From
/// the 7th series on colours repeat; draw those dashed.
const char* PlotPalette(std::size_t k);
constexpr std::size_t kPlotPaletteSize = 6;
/// Colour of the k-th recording that a map held before, in every picture and page (view.js, base.js); none is
/// that of a run's own trajectory.
const char* SessionColor(std::size_t k);

/// The shapes of a plot on a page of kPlotWidth x kPlotHeight. Points that are not finite are left out.
std::vector<PlotShape> LayOut(const TrajectoryPlot& plot);
std::vector<PlotShape> LayOut(const CurvePlot& plot);
std::vector<PlotShape> LayOut(const PanelPlot& plot);
std::vector<PlotShape> LayOut(const DistributionPlot& plot);

/// Writes any of these. Throws InputError if the file can't be written in full.
template <class Plot>
void WriteSvg(const std::filesystem::path& file, const Plot& plot) {
  WritePlot(file, PlotFormat::kSvg, LayOut(plot));
}
template <class Plot>
void WritePng(const std::filesystem::path& file, const Plot& plot) {
  WritePlot(file, PlotFormat::kPng, LayOut(plot));
}

}  // namespace tutti
