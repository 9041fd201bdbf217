// Plots of trajectories seen from above, and of curves over two axes, as SVG and as PNG.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace tutti {

/// One line of the plot.
struct PlotSeries {
  std::string name;                     ///< for the legend
  std::vector<Eigen::Vector3d> points;  ///< [m]
  std::string color = "#000000";        ///< #rrggbb
  double width = 1.5;                   ///< [px]
  bool dashed = false;
};

/// What to draw. The two axes with the largest extent (of the first series, then of all) span the plane.
struct TrajectoryPlot {
  std::string title;
  std::string unit = "m";  ///< of both axes
  std::vector<PlotSeries> series;
  std::string edges_name = "loops";
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> edges;  ///< loop edges
  std::string edges_color = "#009e73";
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

/// Curves between 0 and 1 on both axes, such as precision over recall.
struct CurvePlot {
  std::string title, x_name, y_name;
  std::vector<PlotCurve> curves;
  std::vector<std::string> notes;  ///< lines below the legend
};

/// Writes the plot. Throws InputError if the file can't be written in full. Points that are not finite are
/// left out.
void WriteSvg(const std::filesystem::path& file, const TrajectoryPlot& plot);
void WritePng(const std::filesystem::path& file, const TrajectoryPlot& plot);
void WriteSvg(const std::filesystem::path& file, const CurvePlot& plot);
void WritePng(const std::filesystem::path& file, const CurvePlot& plot);

}  // namespace tutti
