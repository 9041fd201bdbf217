// Box plots and densities with known answers, heat colours, panels.
#include "apps/plot/plot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "apps/plot/plot_lines.h"
#include "apps/plot/plot_picture.h"

namespace tutti {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TEST(Distribution, BoxesHaveNumpysQuartilesAndTukeysWhiskers) {
  const BoxNumbers box = BoxOf({11, 1, 30, 2, kNaN, 2.5, 7, 4});
  EXPECT_DOUBLE_EQ(box.first_quartile, 2.25);
  EXPECT_DOUBLE_EQ(box.median, 4);
  EXPECT_DOUBLE_EQ(box.third_quartile, 9);
  EXPECT_DOUBLE_EQ(box.low, 1);
  EXPECT_DOUBLE_EQ(box.high, 11);  // 30 is beyond 9 + 1.5 * 6.75
  EXPECT_EQ(BoxOf({}).median, 0);
  EXPECT_EQ(BoxOf({5}).low, 5);
}

TEST(Distribution, TheDensityIsThatOfAGaussianKernel) {
  const auto density = DensityOf({1, 2, 2.5, 4, 7, 11, 30}, 3);
  ASSERT_EQ(density.size(), 3u);
  EXPECT_DOUBLE_EQ(density[1].x(), 15.5);
  EXPECT_NEAR(density[0].y(), 0.0405019026819824, 1e-9);
  EXPECT_NEAR(density[1].y(), 0.017072095335939654, 1e-9);
  EXPECT_NEAR(density[2].y(), 0.008476630941776132, 1e-9);
  EXPECT_TRUE(DensityOf({3, 3, 3}, 10).empty());
  EXPECT_TRUE(DensityOf({}, 10).empty());
}

TEST(Distribution, EveryKindIsDrawnWithinThePage) {
  DistributionPlot plot;
  plot.y_name = "error [m]";
  plot.distributions = {
      {"a", {1, 2, 3, 4, 50}, "#0072b2"}, {"b", {kNaN}, "#d55e00"}, {"c", {2, 2}, "#009e73"}};
  for (const bool violins : {false, true}) {
    plot.violins = violins;
    int texts = 0;
    for (const PlotShape& shape : LayOut(plot)) {
      texts += shape.text == "a" || shape.text == "b" || shape.text == "c" ? 1 : 0;
      for (const Eigen::Vector2d& p : shape.points)
        EXPECT_TRUE(p.x() >= 0 && p.x() <= kPlotWidth && p.y() >= 0 && p.y() <= kPlotHeight) << p.transpose();
    }
    EXPECT_EQ(texts, 3);
  }
  EXPECT_FALSE(LayOut(DistributionPlot()).empty());
}

TEST(Heat, ColoursGrowBrighterWithTheValue) {
  EXPECT_EQ(HeatColor(0), "#0d0887");
  EXPECT_EQ(HeatColor(1), "#fbb32f");
  EXPECT_EQ(HeatColor(2), HeatColor(1));
  double last = -1;
  for (int k = 0; k <= 20; ++k) {
    const cv::Scalar bgr = PlotColor(HeatColor(k / 20.0));
    const double brightness = 0.114 * bgr[0] + 0.587 * bgr[1] + 0.299 * bgr[2];
    EXPECT_GT(brightness, last) << k;
    last = brightness;
  }
}

TEST(Heat, ALineHasTheColoursOfItsValuesAndEndsWhereThereIsNone) {
  std::vector<PlotShape> shapes;
  AddHeatLine({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {4, 0}}, {0, 0, 0, kNaN, 10}, 0, 10, 3, shapes);
  ASSERT_EQ(shapes.size(), 1u);  // the others have an end without value
  EXPECT_EQ(shapes[0].points.size(), 3u);
  shapes.clear();
  AddHeatLine({{0, 0}, {1, 0}, {2, 0}}, {0, 0, 20}, 0, 10, 3, shapes);
  ASSERT_EQ(shapes.size(), 2u);
  EXPECT_NE(shapes[0].color, shapes[1].color);
  EXPECT_EQ(shapes[0].points.back(), shapes[1].points.front());
  shapes.clear();
  AddHeatLine({{0, 0}, {1, 0}}, {5, 5}, 5, 5, 3, shapes);  // all errors are the same
  EXPECT_EQ(shapes.size(), 1u);
}

TEST(Heat, AMapOfErrorsHasABarWithTheirLimits) {
  TrajectoryPlot plot;
  plot.values_name = "error [m]";
  PlotSeries series{"a", {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}, "#000000", 2, false};
  series.values = {0.25, 0.5, 0.75};
  plot.series.push_back(series);
  int found = 0;
  for (const PlotShape& shape : LayOut(plot))
    found += shape.text == "0.25" || shape.text == "0.75" || shape.text == "error [m]" ? 1 : 0;
  EXPECT_EQ(found, 3);
}

TEST(Panels, EachHasItsOwnRangeAndALineEndsAtWhatIsNotFinite) {
  PanelPlot plot;
  plot.x_name = "time [s]";
  plot.title = "Positions";
  plot.panels = {{"x [m]", {{"a", {{0, 1}, {1, 2}, {2, kNaN}, {3, 5}, {4, 6}}, "#0072b2", 2, false, {}}}},
                 {"y [m]", {{"a", {{0, 1000}, {4, 3000}}, "#0072b2", 2, false, {}}}},
                 {"z [m]", {{"a", {{0, 7}, {4, 7}}, "#0072b2", 2, false, {}}}}};
  int lines = 0;
  for (const PlotShape& shape : LayOut(plot)) {
    lines += shape.kind == PlotShape::Kind::kLine && shape.color == "#0072b2" ? 1 : 0;
    for (const Eigen::Vector2d& p : shape.points)
      EXPECT_TRUE(p.x() >= 0 && p.x() <= kPlotWidth && p.y() >= 0 && p.y() <= kPlotHeight) << p.transpose();
  }
  EXPECT_EQ(lines, 2 + 1 + 1 + 1);  // and the legend's
  plot.panels = {{"x", {}}};
  EXPECT_FALSE(LayOut(plot).empty());
}

}  // namespace
}  // namespace tutti
