#include "apps/plot/plot_picture.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

namespace tutti {
namespace {

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

}  // namespace tutti
