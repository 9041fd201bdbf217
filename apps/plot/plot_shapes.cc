#include "apps/plot/plot_shapes.h"

namespace tutti {
PlotShape PlotLine(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const std::string& color,
                   double width) {
  PlotShape shape;
  shape.points = {a, b};
  shape.color = color;
  shape.size = width;
  return shape;
}

void AddBrokenLine(PlotShape line, const std::vector<Eigen::Vector2d>& points,
                   std::vector<PlotShape>& shapes) {
  const auto end_piece = [&] {
    if (!line.points.empty()) shapes.push_back(line);
    line.points.clear();
  };
  line.points.clear();
  for (const Eigen::Vector2d& p : points) {
    if (p.allFinite()) {
      line.points.push_back(p);
    } else {
      end_piece();
    }
  }
  end_piece();
}

PlotShape PlotDisc(const Eigen::Vector2d& at, double radius, const std::string& color) {
  PlotShape shape;
  shape.kind = PlotShape::Kind::kDisc;
  shape.points = {at};
  shape.color = color;
  shape.size = radius;
  return shape;
}

PlotShape PlotBox(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const std::string& color) {
  PlotShape shape;
  shape.kind = PlotShape::Kind::kBox;
  shape.points = {a, b};
  shape.color = color;
  return shape;
}

PlotShape PlotText(const Eigen::Vector2d& at, const std::string& text, double height,
                   PlotShape::Anchor anchor) {
  PlotShape shape;
  shape.kind = PlotShape::Kind::kText;
  shape.points = {at};
  shape.text = text;
  shape.color = kPlotInk;
  shape.size = height;
  shape.anchor = anchor;
  return shape;
}

}  // namespace tutti
