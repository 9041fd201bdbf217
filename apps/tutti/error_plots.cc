// Errors along the path, on the map, and as distributions.
#include <cmath>
#include <cstdio>
#include <limits>

#include "apps/plot/plot.h"
#include "apps/tutti/text_table.h"
#include "apps/tutti/trajectory_plots.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

/// Distance along the associated reference [m].
std::vector<double> Path(const EvaluationReport& report) {
  std::vector<double> path;
  for (std::size_t k = 0; k < report.pairs; ++k) {
    const std::vector<Pose>& poses = report.poses.reference;
    path.push_back(k == 0 ? 0 : path.back() + (poses[k].translation - poses[k - 1].translation).norm());
  }
  return path;
}

CurvePlot AlongThePath() {
  CurvePlot plot;
  plot.fit = true;
  plot.x_name = "distance along the reference [m]";
  plot.y_name = "error [m]";
  return plot;
}

PlotCurve CurveOf(const std::string& name, double rmse, std::size_t k) {
  return {name + ": rmse " + Fixed(rmse, 4) + " m", {}, PlotPalette(k), 1.6, k >= kPlotPaletteSize, {}};
}

CurvePlot AbsoluteErrorCurves(const std::vector<EvaluatedEstimate>& estimates) {
  CurvePlot plot = AlongThePath();
  for (std::size_t k = 0; k < estimates.size(); ++k) {
    const EvaluationReport& report = estimates[k].report;
    const std::vector<double> path = Path(report);
    PlotCurve curve = CurveOf(estimates[k].name, report.ate.rmse, k);
    for (std::size_t i = 0; i < report.pairs; ++i)
      curve.points.emplace_back(path[i], report.absolute.translation[i]);
    plot.curves.push_back(std::move(curve));
  }
  return plot;
}

CurvePlot RelativeErrorCurves(const std::vector<EvaluatedEstimate>& estimates) {
  CurvePlot plot = AlongThePath();
  for (std::size_t k = 0; k < estimates.size(); ++k) {
    const EvaluationReport& report = estimates[k].report;
    if (!report.rotations)
      throw InputError(estimates[k].file +
                       ": the reference or it has positions alone, which have no relative error; choose "
                       "--what error");
    if (report.rpe.count == 0) {
      throw InputError(estimates[k].file + ": no two of its poses are that far apart; choose a smaller " +
                       "--rpe-delta");
    }
    const std::vector<double> path = Path(report);
    PlotCurve curve = CurveOf(estimates[k].name, report.rpe.rmse, k);
    for (std::size_t i = 0; i < report.relative_pairs.size(); ++i)
      curve.points.emplace_back(path[report.relative_pairs[i].second], report.relative.translation[i]);
    plot.curves.push_back(std::move(curve));
  }
  return plot;
}

/// All estimates on one scale of colours; the reference is a thin dashed line.
TrajectoryPlot ErrorMap(const std::vector<EvaluatedEstimate>& estimates) {
  TrajectoryPlot plot;
  plot.values_name = "absolute translation error [m]";
  for (const DrawnTrajectory& drawn : DrawnEstimates(estimates)) {
    PlotSeries series{drawn.name, {}, drawn.color, drawn.width, drawn.dashed};
    for (const Pose& pose : drawn.poses) series.points.push_back(pose.translation);
    plot.series.push_back(std::move(series));
  }
  plot.series.front().width = 1;
  for (std::size_t k = 0; k < estimates.size(); ++k) {
    plot.series[k + 1].values = estimates[k].report.absolute.translation;
    plot.series[k + 1].width = 3;
  }
  return plot;
}

DistributionPlot Distributions(const std::vector<EvaluatedEstimate>& estimates, bool violins) {
  DistributionPlot plot;
  plot.violins = violins;
  plot.y_name = "error [m]";
  for (std::size_t k = 0; k < estimates.size(); ++k)
    plot.distributions.push_back(
        {estimates[k].name, estimates[k].report.absolute.translation, PlotPalette(k)});
  return plot;
}

}  // namespace

std::vector<PlotShape> ErrorShapes(const std::vector<EvaluatedEstimate>& estimates, const std::string& what,
                                   const std::string& title) {
  const EvaluationOptions& options = estimates.front().options;
  const std::string absolute =
      std::string("Absolute translation error, alignment ") + ToString(options.alignment);
  if (what == "rpe") {
    char text[96];
    std::snprintf(text, sizeof text, "Relative translation error over %g %s", options.rpe_delta,
                  ToString(options.rpe_unit));
    return Titled(RelativeErrorCurves(estimates), title, text);
  }
  if (what == "error-map") return Titled(ErrorMap(estimates), title, absolute);
  if (what == "box" || what == "violin")
    return Titled(Distributions(estimates, what == "violin"), title, absolute);
  return Titled(AbsoluteErrorCurves(estimates), title, absolute);
}

}  // namespace tutti::cli
