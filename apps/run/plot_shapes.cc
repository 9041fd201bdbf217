#include "apps/run/plot_shapes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

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

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kFontScale = 1.0 / 30.0;  // per pixel of text height
constexpr int kShift = 4;                  // sub-pixel bits of OpenCV's drawing functions

cv::Point Fixed(const Eigen::Vector2d& p) {
  return {static_cast<int>(std::lround(p.x() * (1 << kShift))),
          static_cast<int>(std::lround(p.y() * (1 << kShift)))};
}

// Dashes run on over the corners of a polyline.
void DrawLine(cv::Mat& image, const PlotShape& shape) {
  const int width = std::max(1, static_cast<int>(std::lround(shape.size)));
  double along = 0;
  for (std::size_t i = 1; i < shape.points.size(); ++i) {
    const Eigen::Vector2d a = shape.points[i - 1], b = shape.points[i];
    const double length = (b - a).norm();
    if (!shape.dashed) {
      cv::line(image, Fixed(a), Fixed(b), PlotColor(shape.color), width, cv::LINE_AA, kShift);
      continue;
    }
    for (double s = 0; s < length;) {
      const double phase = std::fmod(along + s, 12.0);
      const double step = std::min(length - s, (phase < 7 ? 7 - phase : 12 - phase) + 1e-6);
      if (phase < 7) {
        const Eigen::Vector2d from = a + (b - a) * (s / length), to = a + (b - a) * ((s + step) / length);
        cv::line(image, Fixed(from), Fixed(to), PlotColor(shape.color), width, cv::LINE_AA, kShift);
      }
      s += step;
    }
    along += length;
  }
}

void DrawText(cv::Mat& image, const PlotShape& shape) {
  const int font = kFont;
  const double scale = shape.size * kFontScale;
  int base = 0;
  const cv::Size size = cv::getTextSize(shape.text, font, scale, 1, &base);
  const double shift = shape.anchor == PlotShape::Anchor::kStart    ? 0.0
                       : shape.anchor == PlotShape::Anchor::kMiddle ? 0.5 * size.width
                                                                    : size.width;
  const Eigen::Vector2d& at = shape.points[0];
  if (!shape.vertical) {
    cv::putText(image, shape.text, cv::Point(static_cast<int>(at.x() - shift), static_cast<int>(at.y())),
                font, scale, PlotColor(shape.color), 1, cv::LINE_AA);
    return;
  }
  cv::Mat patch(size.height + base + 2, size.width + 2, CV_8UC3, cv::Scalar::all(255));
  cv::putText(patch, shape.text, cv::Point(1, size.height + 1), font, scale, PlotColor(shape.color), 1,
              cv::LINE_AA);
  cv::rotate(patch, patch, cv::ROTATE_90_COUNTERCLOCKWISE);
  const cv::Rect where(static_cast<int>(at.x()) - size.height, static_cast<int>(at.y() - size.width + shift),
                       patch.cols, patch.rows);
  const cv::Rect page(0, 0, image.cols, image.rows);
  if ((where & page) == where) patch.copyTo(image(where));
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

cv::Scalar PlotColor(const std::string& hex) {
  unsigned value = 0;
  if (std::sscanf(hex.c_str(), "#%6x", &value) != 1) value = 0;
  return cv::Scalar(value & 0xff, (value >> 8) & 0xff, (value >> 16) & 0xff);
}

double TextWidth(const std::string& text, double height) {
  int base = 0;
  return cv::getTextSize(text, kFont, height * kFontScale, 1, &base).width;
}

void DrawShapes(const std::vector<PlotShape>& shapes, cv::Mat& picture) {
  for (const PlotShape& shape : shapes) {
    switch (shape.kind) {
      case PlotShape::Kind::kLine:
        DrawLine(picture, shape);
        break;
      case PlotShape::Kind::kText:
        DrawText(picture, shape);
        break;
      case PlotShape::Kind::kDisc:
        cv::circle(picture, Fixed(shape.points[0]), static_cast<int>(shape.size * (1 << kShift)),
                   PlotColor(shape.color), cv::FILLED, cv::LINE_AA, kShift);
        break;
      case PlotShape::Kind::kBox:
        cv::rectangle(picture, Fixed(shape.points[0]), Fixed(shape.points[1]), PlotColor(shape.color),
                      cv::FILLED, cv::LINE_8, kShift);
        break;
    }
  }
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

void WritePicture(const std::filesystem::path& file, const cv::Mat& picture) {
  bool written = false;
  try {
    written = cv::imwrite(file.string(), picture);
  } catch (const cv::Exception&) {
    written = false;
  }
  if (!written)
    throw InputError(file.string() + ": can't be written; check that the folder is writable and not full");
}

}  // namespace tutti
