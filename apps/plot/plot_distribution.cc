#include <algorithm>
#include <cmath>

#include "apps/plot/plot.h"

namespace tutti {
namespace {

std::vector<double> Finite(std::vector<double> values) {
  values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); }),
               values.end());
  std::sort(values.begin(), values.end());
  return values;
}

double QuantileOf(const std::vector<double>& sorted, double share) {
  const double at = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

PlotShape Outline(const std::vector<Eigen::Vector2d>& points, const std::string& color, double width) {
  return {PlotShape::Kind::kLine, points, color, width};
}

void AddBox(const BoxNumbers& box, double center, double half, const std::string& color, const PlotAxes& axes,
            std::vector<PlotShape>& shapes) {
  const auto at = [&](double x, double y) { return axes.Page({x, y}); };
  const double q1 = box.first_quartile, q3 = box.third_quartile;
  shapes.push_back(Outline({at(center - half, q1), at(center + half, q1), at(center + half, q3),
                            at(center - half, q3), at(center - half, q1)},
                           color, 2));
  shapes.push_back(PlotLine(at(center - half, box.median), at(center + half, box.median), color, 3));
  for (const auto& [from, to] : {std::pair(q1, box.low), std::pair(q3, box.high)}) {
    shapes.push_back(PlotLine(at(center, from), at(center, to), color, 1.5));
    shapes.push_back(PlotLine(at(center - 0.5 * half, to), at(center + 0.5 * half, to), color, 1.5));
  }
}

void AddViolin(const std::vector<double>& values, double center, double half, const std::string& color,
               const PlotAxes& axes, std::vector<PlotShape>& shapes) {
  const std::vector<Eigen::Vector2d> density = DensityOf(values, 100);
  double most = 0;
  for (const Eigen::Vector2d& d : density) most = std::max(most, d.y());
  if (!(most > 0)) return;
  std::vector<Eigen::Vector2d> outline;
  for (const Eigen::Vector2d& d : density)
    outline.push_back(axes.Page({center + half * d.y() / most, d.x()}));
  for (auto d = density.rbegin(); d != density.rend(); ++d)
    outline.push_back(axes.Page({center - half * d->y() / most, d->x()}));
  outline.push_back(outline.front());
  shapes.push_back(Outline(outline, color, 1.5));
}

/// Values beyond the whiskers.
void AddOutliers(const std::vector<double>& sorted, const BoxNumbers& box, double center,
                 const std::string& color, const PlotAxes& axes, std::vector<PlotShape>& shapes) {
  double last_y = -1;
  for (const double value : sorted) {
    if (value >= box.low && value <= box.high) continue;
    const Eigen::Vector2d at = axes.Page({center, value});
    if (std::abs(at.y() - last_y) < 1) continue;  // one over the other
    shapes.push_back(PlotDisc(at, 2, color));
    last_y = at.y();
  }
}

}  // namespace

BoxNumbers BoxOf(std::vector<double> values) {
  const std::vector<double> sorted = Finite(std::move(values));
  BoxNumbers box;
  if (sorted.empty()) return box;
  box.first_quartile = QuantileOf(sorted, 0.25);
  box.median = QuantileOf(sorted, 0.5);
  box.third_quartile = QuantileOf(sorted, 0.75);
  const double reach = 1.5 * (box.third_quartile - box.first_quartile);
  box.low = *std::lower_bound(sorted.begin(), sorted.end(), box.first_quartile - reach);
  box.high = *std::prev(std::upper_bound(sorted.begin(), sorted.end(), box.third_quartile + reach));
  return box;
}

std::vector<Eigen::Vector2d> DensityOf(const std::vector<double>& values, std::size_t count) {
  const std::vector<double> sorted = Finite(values);
  if (sorted.empty() || !(sorted.back() > sorted.front()) || count < 2) return {};
  const double n = static_cast<double>(sorted.size());
  double mean = 0, squares = 0;
  for (const double v : sorted) mean += v / n;
  for (const double v : sorted) squares += (v - mean) * (v - mean);
  const double bandwidth = std::sqrt(squares / (n - 1)) * std::pow(n, -0.2);
  std::vector<Eigen::Vector2d> out;
  for (std::size_t k = 0; k < count; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(count - 1);
    const double at = sorted.front() + share * (sorted.back() - sorted.front());
    double density = 0;
    for (const double v : sorted) density += std::exp(-0.5 * std::pow((at - v) / bandwidth, 2));
    out.emplace_back(at, density / (n * bandwidth * std::sqrt(2 * M_PI)));
  }
  return out;
}

std::vector<PlotShape> LayOut(const DistributionPlot& plot) {
  PlotAxes axes;
  axes.title = plot.title;
  axes.y_name = plot.y_name;
  axes.x_ticks = 0.1;  // names instead of numbers
  double most = 0;
  for (const PlotDistribution& d : plot.distributions) {
    for (const double value : d.values) {
      if (std::isfinite(value)) most = std::max(most, value);
    }
  }
  const double count = std::max<double>(1, static_cast<double>(plot.distributions.size()));
  axes.low = {0.01, 0};
  axes.high = {count + 0.01, most > 0 ? 1.05 * most : 1};
  std::vector<PlotShape> shapes;
  AddAxes(axes, shapes);
  double center = 0.51;
  for (const PlotDistribution& d : plot.distributions) {
    const std::vector<double> sorted = Finite(d.values);
    const Eigen::Vector2d below = axes.Page({center, 0});
    shapes.push_back(PlotText({below.x(), below.y() + 20}, d.name, 14, PlotShape::Anchor::kMiddle));
    const BoxNumbers box = BoxOf(sorted);
    if (!sorted.empty() && plot.violins) AddViolin(sorted, center, 0.4, d.color, axes, shapes);
    if (!sorted.empty()) AddBox(box, center, plot.violins ? 0.06 : 0.25, d.color, axes, shapes);
    if (!plot.violins) AddOutliers(sorted, box, center, d.color, axes, shapes);
    center += 1;
  }
  return shapes;
}

}  // namespace tutti
