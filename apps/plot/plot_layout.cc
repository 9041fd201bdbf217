#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "apps/plot/plot_lines.h"

namespace tutti {
namespace {

// Which part of the world is seen, and where it lies on the page; both axes have the same scale.
struct View {
  int axis_x = 0, axis_y = 1;
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double scale = 1;  // [px/m]

  Eigen::Vector2d World(const Eigen::Vector3d& p) const { return {p[axis_x], p[axis_y]}; }
  // The values at the ends of the axes, at the same scale along both.
  void SetRange(PlotAxes& axes) const {
    const Eigen::Vector2d half = 0.5 * (axes.bottom_right - axes.top_left) / scale;
    axes.low = center - half;
    axes.high = center + half;
  }
};

View ChooseView(const TrajectoryPlot& plot, const PlotAxes& page) {
  Eigen::AlignedBox3d all, first;
  for (const PlotSeries& series : plot.series) {
    for (const Eigen::Vector3d& p : series.points) {
      if (!p.allFinite()) continue;
      all.extend(p);
      if (&series == &plot.series.front()) first.extend(p);
    }
  }
  View view;
  if (all.isEmpty()) return view;
  const Eigen::Vector3d size = first.isEmpty() ? all.sizes() : first.sizes();
  std::array<int, 3> order = {0, 1, 2};
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return size[a] > size[b]; });
  view.axis_x = std::min(order[0], order[1]);
  view.axis_y = std::max(order[0], order[1]);
  view.center = 0.5 * (view.World(all.min()) + view.World(all.max()));
  const Eigen::Vector2d extent = (view.World(all.max()) - view.World(all.min())).cwiseMax(1e-9);
  view.scale = 0.94 * ((page.bottom_right - page.top_left).array() / extent.array()).minCoeff();
  return view;
}

// Precision-recall curves: at the lower left, where they rarely pass; on white, as they may. Fitted axes: at
// the top, where FittedAxes leaves room.
void AddNotes(const CurvePlot& plot, const std::vector<NamedLine>& curves, const PlotAxes& axes,
              std::vector<PlotShape>& shapes) {
  const double lines = static_cast<double>(curves.size() + plot.notes.size());
  double width = 0;
  for (const NamedLine& curve : curves) width = std::max(width, 42 + TextWidth(curve.name, 14));
  for (const std::string& note : plot.notes) width = std::max(width, TextWidth(note, 14));
  const double x = axes.top_left.x() + 20;
  double y = plot.fit ? axes.top_left.y() + 28 : axes.bottom_right.y() - 20 * lines;
  shapes.push_back(PlotBox({x - 8, y - 20}, {x + width + 16, y + 20 * lines - 8}, "#ffffff"));
  for (const NamedLine& curve : curves) {
    AddLegend({curve}, x, x + 1, y + 8, shapes);
    y += 20;
  }
  for (const std::string& note : plot.notes) {
    shapes.push_back(PlotText({x, y}, note, 14));
    y += 20;
  }
}

// A little room beyond 0 and 1, so that a curve along the frame is seen.
PlotAxes UnitAxes() {
  PlotAxes axes;
  axes.low = {-0.02, -0.02};
  axes.high = {1.02, 1.02};
  axes.x_ticks = axes.y_ticks = 11;  // steps of 0.1
  return axes;
}

// From 0 to what the curves reach, with room for the legend above.
PlotAxes FittedAxes(const CurvePlot& plot) {
  PlotAxes axes;
  Eigen::Vector2d high(0, 0);
  for (const PlotCurve& curve : plot.curves) {
    for (const Eigen::Vector2d& p : curve.points) {
      if (p.allFinite()) high = high.cwiseMax(p);
    }
  }
  for (int axis = 0; axis < 2; ++axis) {
    if (!(high[axis] > 0)) high[axis] = 1;
  }
  const double page = axes.bottom_right.y() - axes.top_left.y();
  const double lines = static_cast<double>(plot.curves.size() + plot.notes.size());
  const double room = std::min(0.5, (20 * lines + 30) / page);
  axes.high = {high.x(), high.y() / (1 - room)};
  return axes;
}

// Series with values, and what their colours mean.
void AddHeat(const TrajectoryPlot& plot, const View& view, const PlotAxes& axes,
             std::vector<PlotShape>& shapes) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const PlotSeries& series : plot.series) {
    for (const double value : series.values) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  if (!(low <= high)) return;
  for (const PlotSeries& series : plot.series) {
    if (series.values.empty()) continue;
    std::vector<Eigen::Vector2d> points;
    for (const Eigen::Vector3d& p : series.points) points.push_back(axes.Page(view.World(p)));
    AddHeatLine(points, series.values, low, high, series.width, shapes);
  }
  AddHeatBar(axes, plot.values_name, low, high, shapes);
}

}  // namespace

const char* PlotPalette(std::size_t k) {
  static constexpr const char* kColors[kPlotPaletteSize] = {"#0072b2", "#d55e00", "#009e73",
                                                            "#cc79a7", "#e69f00", "#56b4e9"};
  return kColors[k % kPlotPaletteSize];
}

const char* SessionColor(std::size_t k) {
  static constexpr std::array kColors = {"#cc79a7", "#56b4e9", "#8f7d2f", "#999999", "#7a5195", "#5a9a8f"};
  return kColors[k % kColors.size()];
}

std::vector<PlotShape> LayOut(const TrajectoryPlot& plot) {
  std::vector<NamedLine> lines, others;
  bool heat = false;
  for (const PlotSeries& series : plot.series) {
    heat = heat || !series.values.empty();
    if (series.values.empty()) lines.push_back({series.name, {}, series.color, series.width, series.dashed});
  }
  if (!plot.edges.empty()) others.push_back({plot.edges_name, {}, plot.edges_color});
  if (!plot.marks.empty()) others.push_back({plot.marks_name, {}, "", 2, false, true});
  PlotAxes axes;
  if (heat) axes.bottom_right.x() -= kHeatBarRoom;
  const auto all = [&] {
    std::vector<NamedLine> entries = lines;
    entries.insert(entries.end(), others.begin(), others.end());
    return entries;
  };
  // Above the box, where no line is.
  axes.top_left.y() += LegendHeight(all(), axes.top_left.x(), axes.bottom_right.x());
  const View view = ChooseView(plot, axes);
  view.SetRange(axes);
  const char* names = "xyz";
  axes.x_name = names[view.axis_x] + (" [" + plot.unit + "]");
  axes.y_name = names[view.axis_y] + (" [" + plot.unit + "]");
  std::vector<PlotShape> shapes;
  AddAxes(axes, shapes);
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  auto line = lines.begin();
  for (const PlotSeries& series : plot.series) {
    if (!series.values.empty()) continue;
    for (const Eigen::Vector3d& p : series.points)
      line->points.push_back(p.allFinite() ? axes.Page(view.World(p)) : Eigen::Vector2d(kNone, kNone));
    ++line;
  }
  AddLines(lines, shapes);
  AddHeat(plot, view, axes, shapes);
  for (const auto& [a, b] : plot.edges) {
    const Eigen::Vector2d from = axes.Page(view.World(a)), to = axes.Page(view.World(b));
    shapes.push_back(PlotLine(from, to, plot.edges_color, 1.5));
    for (const Eigen::Vector2d& end : {from, to}) shapes.push_back(PlotDisc(end, 3, plot.edges_color));
  }
  for (const Eigen::Vector3d& mark : plot.marks) {
    if (mark.allFinite()) shapes.push_back(PlotRing(axes.Page(view.World(mark))));
  }
  AddLegend(all(), axes.top_left.x(), axes.bottom_right.x(), axes.top_left.y(), shapes);
  const PlotAxes page;
  shapes.push_back(PlotText({0.5 * (page.top_left.x() + page.bottom_right.x()), page.top_left.y() - 20},
                            plot.title, 18, PlotShape::Anchor::kMiddle));
  return shapes;
}

std::vector<PlotShape> LayOut(const CurvePlot& plot) {
  PlotAxes axes = plot.fit ? FittedAxes(plot) : UnitAxes();
  axes.title = plot.title;
  axes.x_name = plot.x_name;
  axes.y_name = plot.y_name;
  std::vector<PlotShape> shapes, curves;
  AddAxes(axes, shapes);
  std::vector<NamedLine> lines;
  for (const PlotCurve& curve : plot.curves) {
    lines.push_back(LineOf(curve));
    for (const Eigen::Vector2d& p : curve.points) {
      if (p.allFinite()) lines.back().points.push_back(axes.Page(p));
    }
  }
  AddLines(lines, curves);
  AddNotes(plot, lines, axes, shapes);
  shapes.insert(shapes.end(), curves.begin(), curves.end());
  for (const PlotCurve& curve : plot.curves) {
    for (const Eigen::Vector2d& p : curve.marks) {
      if (p.allFinite()) shapes.push_back(PlotDisc(axes.Page(p), 6, curve.color));
    }
  }
  return shapes;
}

}  // namespace tutti
