#include "apps/plot/plot_shapes.h"

#include <cmath>
#include <cstdio>

namespace tutti {
namespace {

using Anchor = PlotShape::Anchor;

void AddTicks(const PlotAxes& axes, int axis, std::vector<PlotShape>& shapes) {
  const double left = axes.top_left.x(), right = axes.bottom_right.x();
  const double top = axes.top_left.y(), bottom = axes.bottom_right.y();
  const double low = std::min(axes.low[axis], axes.high[axis]);
  const double high = std::max(axes.low[axis], axes.high[axis]);
  const double step = NiceStep(high - low, axis == 0 ? axes.x_ticks : axes.y_ticks);
  for (double k = std::ceil(low / step); k * step <= high; ++k) {
    const double value = k * step;
    Eigen::Vector2d at = axes.low;
    at[axis] = value;
    const Eigen::Vector2d page = axes.Page(at);
    char label[32];
    std::snprintf(label, sizeof label, "%.6g", std::abs(value) < 1e-9 * step ? 0.0 : value);
    const char* color = axes.grid ? kPlotGrid : kPlotInk;
    if (axis == 0) {
      shapes.push_back(PlotLine({page.x(), axes.grid ? top : bottom + 5}, {page.x(), bottom}, color, 1));
      shapes.push_back(PlotText({page.x(), bottom + 20}, label, 14, Anchor::kMiddle));
    } else {
      shapes.push_back(
          PlotLine({axes.grid ? left : left - 5, page.y()}, {axes.grid ? right : left, page.y()}, color, 1));
      shapes.push_back(PlotText({left - 8, page.y() + 5}, label, 14, Anchor::kEnd));
    }
  }
}

}  // namespace

PlotShape PlotLine(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const std::string& color,
                   double width) {
  return {PlotShape::Kind::kLine, {a, b}, color, width};
}

PlotShape PlotDisc(const Eigen::Vector2d& at, double radius, const std::string& color) {
  return {PlotShape::Kind::kDisc, {at}, color, radius};
}

PlotShape PlotBox(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const std::string& color) {
  return {PlotShape::Kind::kBox, {a, b}, color};
}

PlotShape PlotText(const Eigen::Vector2d& at, const std::string& text, double height, Anchor anchor) {
  return {PlotShape::Kind::kText, {at}, kPlotInk, height, false, text, anchor};
}

void AddBrokenLine(PlotShape line, const std::vector<Eigen::Vector2d>& points,
                   std::vector<PlotShape>& shapes) {
  const auto end_piece = [&] {
    if (!line.points.empty()) shapes.push_back(line);
    line.points.clear();
  };
  line.points.clear();
  for (const Eigen::Vector2d& p : points) {
    if (p.allFinite())
      line.points.push_back(p);
    else
      end_piece();
  }
  end_piece();
}

double NiceStep(double length, double count) {
  const double raw = length / count, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (raw <= factor * power) return factor * power;
  }
  return 10 * power;
}

Eigen::Vector2d PlotAxes::Page(const Eigen::Vector2d& value) const {
  const Eigen::Vector2d share = (value - low).cwiseQuotient(high - low);
  return {top_left.x() + share.x() * (bottom_right.x() - top_left.x()),
          bottom_right.y() - share.y() * (bottom_right.y() - top_left.y())};
}

void AddAxes(const PlotAxes& axes, std::vector<PlotShape>& shapes) {
  for (int axis = 0; axis < 2; ++axis) AddTicks(axes, axis, shapes);
  const double left = axes.top_left.x(), right = axes.bottom_right.x();
  const double top = axes.top_left.y(), bottom = axes.bottom_right.y();
  const Eigen::Vector2d corners[] = {{left, top}, {right, top}, {right, bottom}, {left, bottom}};
  for (int i = 0; i < 4; ++i) shapes.push_back(PlotLine(corners[i], corners[(i + 1) % 4], kPlotInk, 1));
  const double middle = 0.5 * (left + right);
  shapes.push_back(PlotText({middle, bottom + 48}, axes.x_name, 16, Anchor::kMiddle));
  PlotShape y_name = PlotText({left - 56, 0.5 * (top + bottom)}, axes.y_name, 16, Anchor::kMiddle);
  y_name.vertical = true;
  shapes.push_back(y_name);
  shapes.push_back(PlotText({middle, top - 20}, axes.title, 18, Anchor::kMiddle));
}

}  // namespace tutti
