// How the errors of several estimates are distributed: box plots and violins.
#pragma once

#include <string>
#include <vector>

#include "apps/plot/plot.h"

namespace tutti {

/// The five numbers of a box plot (Tukey, 1977).
struct BoxNumbers {
  double low = 0, high = 0;  ///< whiskers: the outermost values within 1.5 box heights of the box
  double first_quartile = 0, median = 0, third_quartile = 0;
};
/// Quartiles interpolate linearly between values, as NumPy's. Values that are not finite are left out; of
/// none all numbers are 0.
BoxNumbers BoxOf(std::vector<double> values);

/// Gaussian kernel density (Scott's bandwidth, as SciPy's) at `count` evenly spaced values from the least to
/// the largest; (value, density). Of fewer than two distinct values nothing.
std::vector<Eigen::Vector2d> DensityOf(const std::vector<double>& values, std::size_t count);

struct PlotDistribution {
  std::string name;
  std::vector<double> values;
  std::string color = "#000000";  ///< #rrggbb
};

struct DistributionPlot {
  std::string title, y_name;
  std::vector<PlotDistribution> distributions;
  bool violins = false;  ///< the density around each box
};

/// The shapes of a plot on a page of kPlotWidth x kPlotHeight.
std::vector<PlotShape> LayOut(const DistributionPlot& plot);

}  // namespace tutti
