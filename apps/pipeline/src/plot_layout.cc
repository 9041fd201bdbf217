#include "plot_layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

namespace tutti {
namespace {

constexpr double kLeft = 80, kRight = 30, kTop = 50, kBottom = 70;  // margins [px]
constexpr const char* kInk = "#333333";
constexpr const char* kGrid = "#dddddd";

using Anchor = PlotShape::Anchor;

// Which part of the world is seen, and where it lies on the page; both axes have the same scale.
struct View {
  int axis_x = 0, axis_y = 1;
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double scale = 1;  // [px/m]

  Eigen::Vector2d World(const Eigen::Vector3d& p) const { return {p[axis_x], p[axis_y]}; }
  Eigen::Vector2d Page(const Eigen::Vector2d& w) const {
    const Eigen::Vector2d middle(0.5 * (kLeft + kPlotWidth - kRight), 0.5 * (kTop + kPlotHeight - kBottom));
    return {middle.x() + scale * (w.x() - center.x()), middle.y() - scale * (w.y() - center.y())};
  }
};

struct Extent {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
  void Add(const Eigen::Vector3d& p) {
    if (!p.allFinite()) return;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  bool Empty() const { return !(low.x() <= high.x()); }
};

View ChooseView(const TrajectoryPlot& plot) {
  Extent all, first;
  for (const PlotSeries& series : plot.series) {
    for (const Eigen::Vector3d& p : series.points) {
      all.Add(p);
      if (&series == &plot.series.front()) first.Add(p);
    }
  }
  View view;
  if (all.Empty()) return view;
  const Eigen::Vector3d size = first.Empty() ? all.high - all.low : first.high - first.low;
  std::array<int, 3> order = {0, 1, 2};
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return size[a] > size[b]; });
  view.axis_x = std::min(order[0], order[1]);
  view.axis_y = std::max(order[0], order[1]);
  view.center = 0.5 * (view.World(all.low) + view.World(all.high));
  const Eigen::Vector2d extent = (view.World(all.high) - view.World(all.low)).cwiseMax(1e-9);
  view.scale = 0.94 * std::min((kPlotWidth - kLeft - kRight) / extent.x(),
                               (kPlotHeight - kTop - kBottom) / extent.y());
  return view;
}

PlotShape Line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const char* color, double width) {
  PlotShape shape;
  shape.points = {a, b};
  shape.color = color;
  shape.size = width;
  return shape;
}

PlotShape Text(const Eigen::Vector2d& at, const std::string& text, double height, Anchor anchor,
               bool vertical = false) {
  PlotShape shape;
  shape.kind = PlotShape::Kind::kText;
  shape.points = {at};
  shape.text = text;
  shape.color = kInk;
  shape.size = height;
  shape.anchor = anchor;
  shape.vertical = vertical;
  return shape;
}

// 1, 2 or 5 times a power of ten, so that about `count` steps fill `length`.
double NiceStep(double length, double count) {
  const double raw = length / count, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (raw <= factor * power) return factor * power;
  }
  return 10 * power;
}

void AddAxes(const TrajectoryPlot& plot, const View& view, std::vector<PlotShape>& shapes) {
  const double left = kLeft, right = kPlotWidth - kRight, top = kTop, bottom = kPlotHeight - kBottom;
  const char* names = "xyz";
  for (int axis = 0; axis < 2; ++axis) {
    const bool horizontal = axis == 0;
    const double half = 0.5 * (horizontal ? right - left : bottom - top) / view.scale;
    const double low = view.center[axis] - half, high = view.center[axis] + half;
    const double step = NiceStep(high - low, horizontal ? 8 : 6);
    for (double k = std::ceil(low / step); k * step <= high; ++k) {
      const double value = k * step;
      Eigen::Vector2d at = view.center;
      at[axis] = value;
      const Eigen::Vector2d page = view.Page(at);
      char label[32];
      std::snprintf(label, sizeof label, "%.6g", std::abs(value) < 1e-9 * step ? 0.0 : value);
      if (horizontal) {
        shapes.push_back(Line({page.x(), top}, {page.x(), bottom}, kGrid, 1));
        shapes.push_back(Text({page.x(), bottom + 20}, label, 14, Anchor::kMiddle));
      } else {
        shapes.push_back(Line({left, page.y()}, {right, page.y()}, kGrid, 1));
        shapes.push_back(Text({left - 8, page.y() + 5}, label, 14, Anchor::kEnd));
      }
    }
  }
  const Eigen::Vector2d corners[] = {{left, top}, {right, top}, {right, bottom}, {left, bottom}};
  for (int i = 0; i < 4; ++i) shapes.push_back(Line(corners[i], corners[(i + 1) % 4], kInk, 1));
  const std::string unit = " [" + plot.unit + "]";
  shapes.push_back(Text({0.5 * (left + right), bottom + 48}, names[view.axis_x] + unit, 16, Anchor::kMiddle));
  shapes.push_back(Text({24, 0.5 * (top + bottom)}, names[view.axis_y] + unit, 16, Anchor::kMiddle, true));
  shapes.push_back(Text({0.5 * (left + right), 30}, plot.title, 18, Anchor::kMiddle));
}

void AddLegend(const TrajectoryPlot& plot, std::vector<PlotShape>& shapes) {
  double y = kTop + 22;
  const double x = kLeft + 14;
  const auto entry = [&](const std::string& name, const std::string& color, double width, bool dashed) {
    PlotShape line = Line({x, y - 5}, {x + 34, y - 5}, color.c_str(), std::max(2.0, width));
    line.dashed = dashed;
    shapes.push_back(line);
    shapes.push_back(Text({x + 42, y}, name, 14, Anchor::kStart));
    y += 20;
  };
  for (const PlotSeries& series : plot.series) entry(series.name, series.color, series.width, series.dashed);
  if (!plot.edges.empty()) entry(plot.edges_name, plot.edges_color, 2, false);
}

}  // namespace

std::vector<PlotShape> LayOut(const TrajectoryPlot& plot) {
  const View view = ChooseView(plot);
  std::vector<PlotShape> shapes;
  AddAxes(plot, view, shapes);
  for (const PlotSeries& series : plot.series) {
    PlotShape line;
    line.color = series.color;
    line.size = series.width;
    line.dashed = series.dashed;
    for (const Eigen::Vector3d& p : series.points) {
      if (p.allFinite()) line.points.push_back(view.Page(view.World(p)));
    }
    if (!line.points.empty()) shapes.push_back(std::move(line));
  }
  for (const auto& [a, b] : plot.edges) {
    const Eigen::Vector2d from = view.Page(view.World(a)), to = view.Page(view.World(b));
    shapes.push_back(Line(from, to, plot.edges_color.c_str(), 1.5));
    for (const Eigen::Vector2d& end : {from, to}) {
      PlotShape disc;
      disc.kind = PlotShape::Kind::kDisc;
      disc.points = {end};
      disc.color = plot.edges_color;
      disc.size = 3;
      shapes.push_back(disc);
    }
  }
  AddLegend(plot, shapes);
  return shapes;
}

}  // namespace tutti
