#include "apps/plot/plot_shapes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "tutti/core/error.h"

namespace tutti {
namespace {

std::string Escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string SvgElement(const PlotShape& shape) {
  char text[256];
  std::string out;
  switch (shape.kind) {
    case PlotShape::Kind::kLine:
      out = "<polyline fill=\"none\" stroke=\"" + shape.color + "\"";
      std::snprintf(text, sizeof text, " stroke-width=\"%.2g\"%s points=\"", shape.size,
                    shape.dashed ? " stroke-dasharray=\"7 5\"" : "");
      out += text;
      for (const Eigen::Vector2d& p : shape.points) {
        std::snprintf(text, sizeof text, "%.2f,%.2f ", p.x(), p.y());
        out += text;
      }
      return out + "\"/>\n";
    case PlotShape::Kind::kDisc:
      std::snprintf(text, sizeof text, "<circle cx=\"%.2f\" cy=\"%.2f\" r=\"%.2g\" fill=\"%s\"/>\n",
                    shape.points[0].x(), shape.points[0].y(), shape.size, shape.color.c_str());
      return text;
    case PlotShape::Kind::kBox: {
      const Eigen::Vector2d low = shape.points[0].cwiseMin(shape.points[1]);
      const Eigen::Vector2d size = (shape.points[1] - shape.points[0]).cwiseAbs();
      std::snprintf(text, sizeof text,
                    "<rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\" fill=\"%s\"/>\n", low.x(),
                    low.y(), size.x(), size.y(), shape.color.c_str());
      return text;
    }
    case PlotShape::Kind::kText: {
      const char* anchor = shape.anchor == PlotShape::Anchor::kStart    ? "start"
                           : shape.anchor == PlotShape::Anchor::kMiddle ? "middle"
                                                                        : "end";
      const Eigen::Vector2d& p = shape.points[0];
      char turn[80] = "";
      if (shape.vertical)
        std::snprintf(turn, sizeof turn, " transform=\"rotate(-90 %.2f %.2f)\"", p.x(), p.y());
      std::snprintf(text, sizeof text,
                    "<text x=\"%.2f\" y=\"%.2f\" font-size=\"%.3g\" text-anchor=\"%s\" fill=\"%s\"%s>", p.x(),
                    p.y(), shape.size, anchor, shape.color.c_str(), turn);
      return text + Escaped(shape.text) + "</text>\n";
    }
  }
  return out;
}

}  // namespace

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

void WriteSvg(const std::filesystem::path& file, const std::vector<PlotShape>& shapes, int width,
              int height) {
  std::ofstream out(file);
  if (!out)
    throw InputError(file.string() + ": can't be written; check that the folder exists and is writable");
  out << "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " << width << " " << height
      << "\" font-family=\"sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n";
  for (const PlotShape& shape : shapes) out << SvgElement(shape);
  out << "</svg>\n";
  out.flush();
  if (!out) throw InputError(file.string() + ": could not be written in full; is the disk full?");
}

}  // namespace tutti
