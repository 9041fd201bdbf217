#include "apps/plot/plot.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "apps/plot/plot_picture.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::ReadAll;

TrajectoryPlot Circle() {
  TrajectoryPlot plot;
  plot.title = "a < b & c";
  PlotSeries series;
  series.name = "reference";
  series.color = "#0072b2";
  for (int i = 0; i <= 100; ++i)
    series.points.emplace_back(10 * std::cos(0.0628 * i), 0.01 * i, 10 * std::sin(0.0628 * i));
  plot.series.push_back(series);
  plot.edges.emplace_back(series.points[0], series.points[50]);
  return plot;
}

TEST(Plot, SvgHasAxesUnitsLegendAndEscapedTitle) {
  const auto file = testing::FreshFolder() / "p.svg";
  WriteSvg(file, Circle());
  const std::string svg = ReadAll(file);
  EXPECT_NE(svg.find("a &lt; b &amp; c"), std::string::npos);
  EXPECT_NE(svg.find("x [m]"), std::string::npos);  // the flat axis y is not drawn
  EXPECT_NE(svg.find("z [m]"), std::string::npos);
  EXPECT_NE(svg.find("\nreference\n"), std::string::npos);
  EXPECT_NE(svg.find("\nloops\n"), std::string::npos);
  EXPECT_NE(svg.find("</svg>"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
}

TEST(Plot, PlacesHaveARingAndALegend) {
  const auto file = testing::FreshFolder() / "p.svg";
  TrajectoryPlot plot = Circle();
  const auto rings = [&] {
    WriteSvg(file, plot);
    const std::string svg = ReadAll(file), width = "stroke-width:1.6;";
    std::size_t count = 0;
    for (std::size_t at = svg.find(width); at != std::string::npos; at = svg.find(width, at + 1)) ++count;
    return count;
  };
  EXPECT_EQ(rings(), 0u);
  plot.marks_name = "found (1)";
  plot.marks.emplace_back(1, 0, 2);
  EXPECT_EQ(rings(), 2u);  // the place, and the legend
  EXPECT_NE(ReadAll(file).find("\nfound (1)\n"), std::string::npos);
}

// The box of the axes: the longest lines are its grid and frame.
Eigen::AlignedBox2d FrameOf(const std::vector<PlotShape>& shapes) {
  Eigen::AlignedBox2d frame;
  for (const PlotShape& shape : shapes) {
    if (shape.kind != PlotShape::Kind::kLine || shape.color != kPlotInk || shape.size != 1) continue;
    for (const Eigen::Vector2d& p : shape.points) frame.extend(p);
  }
  return frame;
}

TEST(Plot, ColourBarAndLegendLieOutsideOfTheAxes) {
  TrajectoryPlot plot = Circle();
  plot.series.push_back(plot.series[0]);
  plot.series.back().values.assign(plot.series[0].points.size(), 1.0);
  plot.series.back().values[3] = 2.0;
  plot.values_name = "error [m]";
  plot.marks_name = "found (1)";
  plot.marks.emplace_back(1, 0, 2);
  for (int k = 0; k < 12; ++k) plot.series.push_back({"a series with a long name", {}, "#d55e00"});
  const std::vector<PlotShape> shapes = LayOut(plot);
  const Eigen::AlignedBox2d frame = FrameOf(shapes);
  EXPECT_GT(frame.sizes().minCoeff(), 300);
  int boxes = 0, names = 0;
  for (const PlotShape& shape : shapes) {
    if (shape.kind == PlotShape::Kind::kBox) {
      ++boxes;
      for (const Eigen::Vector2d& p : shape.points) EXPECT_GT(p.x(), frame.max().x());
    }
    if (shape.text == "reference" || shape.text == "loops" || shape.text == "found (1)" ||
        shape.text == "a series with a long name") {
      ++names;
      EXPECT_LT(shape.points[0].y(), frame.min().y()) << shape.text;
      EXPECT_GT(shape.points[0].y(), 30) << shape.text;
    }
  }
  EXPECT_GT(boxes, 10);
  EXPECT_EQ(names, 1 + 1 + 1 + 12);
}

TEST(Plot, LinesThatCoverOneAnotherAreToldApart) {
  const auto widths = [](const TrajectoryPlot& plot) {
    std::vector<double> all;
    for (const PlotSeries& series : plot.series) {
      for (const PlotShape& shape : LayOut(plot)) {
        if (shape.kind == PlotShape::Kind::kLine && shape.color == series.color && shape.points.size() > 2)
          all.push_back(shape.size);
      }
    }
    return all;
  };
  TrajectoryPlot plot = Circle();
  for (const char* color : {"#d55e00", "#009e73"}) {
    plot.series.push_back(plot.series[0]);
    plot.series.back().color = color;
  }
  const std::vector<double> covered = widths(plot);
  ASSERT_EQ(covered.size(), 3u);
  EXPECT_GE(covered[0], covered[1] + 2) << "below, and seen on both sides";
  EXPECT_GE(covered[1], covered[2] + 2);
  for (std::size_t k = 1; k < 3; ++k) {
    for (Eigen::Vector3d& p : plot.series[k].points) p.x() += static_cast<double>(k);
  }
  for (const double width : widths(plot)) EXPECT_EQ(width, plot.series[0].width);
}

TEST(Plot, PngIsNotBlank) {
  const auto file = testing::FreshFolder() / "p.png";
  WritePng(file, Circle());
  const cv::Mat image = cv::imread(file.string(), cv::IMREAD_COLOR);
  ASSERT_FALSE(image.empty());
  int blue = 0;
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x)
      blue += image.at<cv::Vec3b>(y, x) == cv::Vec3b(0xb2, 0x72, 0x00) ? 1 : 0;
  }
  EXPECT_GT(blue, 500);
}

TEST(Plot, APictureIsReadAgainPixelByPixel) {
  const auto file = testing::FreshFolder() / "p.png";
  cv::Mat picture(37, 53, CV_8UC3);
  cv::RNG(1).fill(picture, cv::RNG::UNIFORM, 0, 256);
  const cv::Mat part = picture(cv::Rect(3, 2, 41, 30));  // its rows are not next to each other
  WritePicture(file, part);
  const cv::Mat read = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(read.size(), part.size());
  ASSERT_EQ(read.type(), CV_8UC3);
  EXPECT_EQ(cv::norm(read, part, cv::NORM_INF), 0);
}

TEST(Plot, EmptySinglePointAndNonFiniteAreDrawable) {
  const auto folder = testing::FreshFolder();
  TrajectoryPlot plot;
  WriteSvg(folder / "empty.svg", plot);
  plot.series.push_back({"one", {Eigen::Vector3d(1, 2, 3)}, "#000000", 1, false});
  WriteSvg(folder / "one.svg", plot);
  plot.series[0].points.push_back(Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  plot.series[0].dashed = true;
  WritePng(folder / "nan.png", plot);
  EXPECT_EQ(ReadAll(folder / "one.svg").find("nan"), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(folder / "nan.png"));
}

CurvePlot Curves() {
  CurvePlot plot;
  plot.title = "mean & others";
  plot.x_name = "recall";
  plot.y_name = "precision";
  PlotCurve curve;
  curve.name = "verified";
  curve.color = "#d55e00";
  curve.points = {{0, 1}, {0.5, 1}, {0.5, 0.8}, {1, 0.8}};
  curve.marks = {{0.5, 0.8}};
  plot.curves.push_back(curve);
  plot.notes.push_back("a note");
  return plot;
}

TEST(Plot, CurvesHaveAxesLegendNotesAndMarks) {
  const auto folder = testing::FreshFolder();
  WriteSvg(folder / "p.svg", Curves());
  const std::string svg = ReadAll(folder / "p.svg");
  for (const char* text : {"\nrecall\n", "\nprecision\n", "\nverified\n", "\na note\n", "\n0.5\n",
                           "mean &amp; others", "</svg>"})
    EXPECT_NE(svg.find(text), std::string::npos) << text;
  WritePng(folder / "p.png", Curves());
  const cv::Mat image = cv::imread((folder / "p.png").string(), cv::IMREAD_COLOR);
  ASSERT_FALSE(image.empty());
  cv::Mat of_the_curve;
  cv::inRange(image, cv::Scalar(0x00, 0x5e, 0xd5), cv::Scalar(0x00, 0x5e, 0xd5), of_the_curve);
  EXPECT_GT(cv::countNonZero(of_the_curve), 500);
}

TEST(Plot, CurvesThatAreEmptyOrNotFiniteAreDrawable) {
  const auto folder = testing::FreshFolder();
  WriteSvg(folder / "empty.svg", CurvePlot());
  CurvePlot plot = Curves();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  plot.curves[0].points = {{nan, 1}, {0.5, nan}};
  plot.curves[0].marks = {{nan, nan}};
  WriteSvg(folder / "nan.svg", plot);
  WritePng(folder / "nan.png", plot);
  EXPECT_EQ(ReadAll(folder / "nan.svg").find("nan"), std::string::npos);
}

TEST(Plot, FittedAxesReachWhatTheCurvesReach) {
  const auto folder = testing::FreshFolder();
  CurvePlot plot = Curves();
  plot.fit = true;
  plot.curves[0].points = {{0, 0}, {250, 4}, {500, 3}};
  plot.curves[0].marks.clear();
  WriteSvg(folder / "p.svg", plot);
  const std::string svg = ReadAll(folder / "p.svg");
  for (const char* text : {"\n500\n", "\n4\n", "\nverified\n"})
    EXPECT_NE(svg.find(text), std::string::npos) << text;
  for (const PlotShape& shape : LayOut(plot)) {
    for (const Eigen::Vector2d& p : shape.points) {
      EXPECT_TRUE(p.x() >= 0 && p.x() <= kPlotWidth && p.y() >= 0 && p.y() <= kPlotHeight);
    }
  }
  plot.curves[0].points = {{0, 0}, {0, 0}};  // no extent
  WriteSvg(folder / "flat.svg", plot);
  EXPECT_EQ(ReadAll(folder / "flat.svg").find("nan"), std::string::npos);
}

TEST(Plot, AxesThatRunBackPutTheirLowValueAtTheTop) {
  PlotAxes axes;
  axes.low = {0, 10};
  axes.high = {10, 0};
  EXPECT_EQ(axes.Page({0, 0}), axes.top_left);
  EXPECT_EQ(axes.Page({10, 10}), axes.bottom_right);
  std::vector<PlotShape> shapes;
  AddAxes(axes, shapes);
  EXPECT_GT(shapes.size(), 10u);
}

TEST(Plot, UnwritableFileIsAnInputError) {
  EXPECT_THROW(WriteSvg("/proc/no/plot.svg", Circle()), InputError);
  EXPECT_THROW(WritePng("/proc/no/plot.png", Circle()), InputError);
  EXPECT_THROW(WriteSvg("/proc/no/plot.svg", Curves()), InputError);
  EXPECT_THROW(WritePng("/proc/no/plot.png", Curves()), InputError);
}

}  // namespace
}  // namespace tutti
