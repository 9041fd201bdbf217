// tutti plot: trajectories, errors along the path and relative errors as pictures.
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "apps/plot/plot.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/evaluation_input.h"
#include "apps/tutti/plot_file.h"
#include "apps/tutti/text_table.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

struct PlotArguments {
  EvaluationInput input;
  std::vector<std::string> out;
  std::string what = "trajectory", title;
};

bool Dashed(std::size_t k) { return k >= kPlotPaletteSize; }

std::vector<Eigen::Vector3d> Positions(const std::vector<Pose>& poses) {
  std::vector<Eigen::Vector3d> points;
  points.reserve(poses.size());
  for (const Pose& pose : poses) points.push_back(pose.translation);
  return points;
}

// Distance along the associated reference [m].
std::vector<double> Path(const EvaluationReport& report) {
  std::vector<double> path;
  for (std::size_t k = 0; k < report.pairs; ++k) {
    const std::vector<Pose>& poses = report.poses.reference;
    path.push_back(k == 0 ? 0 : path.back() + (poses[k].translation - poses[k - 1].translation).norm());
  }
  return path;
}

TrajectoryPlot Trajectories(const std::vector<EvaluatedEstimate>& estimates) {
  TrajectoryPlot plot;
  plot.title = std::string("Trajectories, alignment ") + ToString(estimates.front().report.alignment);
  // The longest of the references, as estimates may cover parts of it.
  const EvaluatedEstimate* longest = &estimates.front();
  for (const EvaluatedEstimate& estimate : estimates) {
    if (estimate.report.pairs > longest->report.pairs) longest = &estimate;
  }
  plot.series.push_back({"reference", Positions(longest->report.poses.reference), "#333333", 2.5, true});
  for (std::size_t k = 0; k < estimates.size(); ++k) {
    plot.series.push_back(
        {estimates[k].name, Positions(estimates[k].report.poses.estimate), PlotPalette(k), 1.6, Dashed(k)});
  }
  return plot;
}

CurvePlot Errors(const std::vector<EvaluatedEstimate>& estimates) {
  CurvePlot plot;
  plot.fit = true;
  plot.title =
      std::string("Absolute translation error, alignment ") + ToString(estimates.front().report.alignment);
  plot.x_name = "distance along the reference [m]";
  plot.y_name = "error [m]";
  for (std::size_t k = 0; k < estimates.size(); ++k) {
    const EvaluationReport& report = estimates[k].report;
    const std::vector<double> path = Path(report);
    PlotCurve curve{estimates[k].name + ": rmse " + Fixed(report.ate.rmse, 4) + " m",
                    {},
                    PlotPalette(k),
                    1.6,
                    Dashed(k),
                    {}};
    for (std::size_t i = 0; i < report.pairs; ++i)
      curve.points.emplace_back(path[i], report.absolute.translation[i]);
    plot.curves.push_back(std::move(curve));
  }
  return plot;
}

CurvePlot RelativeErrorCurves(const std::vector<EvaluatedEstimate>& estimates) {
  const EvaluationOptions& options = estimates.front().options;
  CurvePlot plot;
  plot.fit = true;
  char title[96];
  std::snprintf(title, sizeof title, "Relative translation error over %g %s", options.rpe_delta,
                ToString(options.rpe_unit));
  plot.title = title;
  plot.x_name = "distance along the reference [m]";
  plot.y_name = "error [m]";
  for (std::size_t k = 0; k < estimates.size(); ++k) {
    const EvaluationReport& report = estimates[k].report;
    if (report.rpe.count == 0) {
      throw InputError(estimates[k].file + ": no two of its poses are that far apart; choose a smaller " +
                       "--rpe-delta");
    }
    const std::vector<double> path = Path(report);
    PlotCurve curve{estimates[k].name + ": rmse " + Fixed(report.rpe.rmse, 4) + " m",
                    {},
                    PlotPalette(k),
                    1.6,
                    Dashed(k),
                    {}};
    for (std::size_t i = 0; i < report.relative_pairs.size(); ++i)
      curve.points.emplace_back(path[report.relative_pairs[i].second], report.relative.translation[i]);
    plot.curves.push_back(std::move(curve));
  }
  return plot;
}

template <typename Plot>
std::vector<PlotShape> Titled(Plot plot, const std::string& title) {
  if (!title.empty()) plot.title = title;
  return LayOut(plot);
}

void RunPlot(const PlotArguments& arguments) {
  for (const std::string& file : arguments.out) CheckPlotFile(file);
  const std::vector<EvaluatedEstimate> estimates = EvaluateInput(Resolved(arguments.input));
  const std::vector<PlotShape> shapes = arguments.what == "error" ? Titled(Errors(estimates), arguments.title)
                                        : arguments.what == "rpe"
                                            ? Titled(RelativeErrorCurves(estimates), arguments.title)
                                            : Titled(Trajectories(estimates), arguments.title);
  for (const std::string& file : arguments.out) {
    WritePlotFile(file, shapes);
    std::printf("%s\n", file.c_str());
  }
}

}  // namespace

void SetUpPlot(CLI::App& command, int&) {
  const auto arguments = std::make_shared<PlotArguments>();
  arguments->input.reference_comes_first = false;
  AddEvaluationOptions(command, arguments->input);
  command
      .add_option(
          "--what", arguments->what,
          "trajectory: seen from above, along the two axes of largest extent; error: absolute "
          "translation error along the path; rpe: relative translation error, at the end of each pair")
      ->check(CLI::IsMember({"trajectory", "error", "rpe"}))
      ->capture_default_str();
  command.add_option("--out", arguments->out, "Files to write; the ending is the format: .svg, .png, .pdf")
      ->required();
  command.add_option("--title", arguments->title, "Text above the plot");
  command.footer(
      "Reads, associates and aligns as `tutti evaluate` does. PDF needs a build with Cairo (Debian: "
      "libcairo2-dev).\n"
      "Examples:\n"
      "  tutti plot --reference gt.txt --estimate a.txt b.txt --out map.svg map.pdf\n"
      "  tutti plot --reference gt.txt --estimate a.txt --what rpe --rpe-delta 10 --rpe-unit metres --out "
      "rpe.png");
  command.callback([arguments] { RunPlot(*arguments); });
}

}  // namespace tutti::cli
