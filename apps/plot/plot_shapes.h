// What every picture of tutti is drawn with: simple shapes on a page, the same in every format
// (plot_picture.h), and axes with ticks. No display, no plotting library.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace tutti {

constexpr int kPlotWidth = 1000;  ///< of a plot's page [px]
constexpr int kPlotHeight = 760;  ///< [px]
constexpr const char* kPlotInk = "#333333";
constexpr const char* kPlotGrid = "#dddddd";

/// A polyline, a filled disc (one point, radius), a filled box (two corners) or a text (one point).
struct PlotShape {
  enum class Kind { kLine, kDisc, kBox, kText } kind = Kind::kLine;
  std::vector<Eigen::Vector2d> points;  ///< [px], y down
  std::string color = "#000000";        ///< #rrggbb
  double size = 1;                      ///< line width, radius or text height [px]
  bool dashed = false;
  std::string text = {};
  enum class Anchor { kStart, kMiddle, kEnd } anchor = Anchor::kStart;
  bool vertical = false;  ///< text that reads upwards
};

PlotShape PlotLine(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const std::string& color,
                   double width);
/// Adds the line through these points of the page in the style of `line`, in pieces where one is not finite.
void AddBrokenLine(PlotShape line, const std::vector<Eigen::Vector2d>& points,
                   std::vector<PlotShape>& shapes);
PlotShape PlotDisc(const Eigen::Vector2d& at, double radius, const std::string& color);
PlotShape PlotBox(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const std::string& color);
PlotShape PlotText(const Eigen::Vector2d& at, const std::string& text, double height,
                   PlotShape::Anchor anchor = PlotShape::Anchor::kStart);

/// 1, 2 or 5 times a power of ten, so that about `count` steps fill `length` > 0.
double NiceStep(double length, double count);

/// Two linear axes around a box on the page.
struct PlotAxes {
  Eigen::Vector2d top_left = {80, 50};                                     ///< of the box [px]
  Eigen::Vector2d bottom_right = {kPlotWidth - 30.0, kPlotHeight - 70.0};  ///< [px]
  Eigen::Vector2d low = {0, 0};   ///< values at the left and at the bottom
  Eigen::Vector2d high = {1, 1};  ///< values at the right and at the top; below `low`: the axis runs back
  std::string title, x_name, y_name;
  double x_ticks = 8, y_ticks = 6;  ///< about so many
  bool grid = true;                 ///< lines across the box; false: short ticks outside of it

  Eigen::Vector2d Page(const Eigen::Vector2d& value) const;  ///< [px]
};

/// Grid, ticks, numbers, frame, names and title.
void AddAxes(const PlotAxes& axes, std::vector<PlotShape>& shapes);

}  // namespace tutti
