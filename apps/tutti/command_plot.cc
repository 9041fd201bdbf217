// tutti plot: trajectories and their errors as pictures.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "apps/plot/plot.h"
#include "apps/plot/plot_picture.h"
#include "apps/plot/plot_shapes.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/evaluation_input.h"
#include "apps/tutti/files.h"
#include "apps/tutti/options.h"
#include "apps/tutti/text_table.h"
#include "core/numbers.h"
#include "tutti/backend/trajectory_file.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

struct PlotArguments {
  EvaluationInput input;
  std::vector<std::string> out;
  std::string what = "trajectory", title;
  PlotFont font;
};

// What can be drawn, in the order of the help.
const std::vector<std::string>& PlotNames() {
  static const std::vector<std::string> names = {"trajectory", "xyz", "rpy",    "speed",    "error",
                                                 "rpe",        "box", "violin", "error-map"};
  return names;
}

// Errors need a reference; the others need none.
bool IsOfErrors(const std::string& what) {
  return what != "trajectory" && what != "xyz" && what != "rpy" && what != "speed";
}

// A trajectory as it is drawn: as the file has it, or associated and aligned.
struct DrawnTrajectory {
  std::string name, file;
  std::vector<double> stamps_s;  // frame numbers where there are no stamps
  bool has_stamps = true, has_rotations = true;
  std::vector<Pose> poses;
  std::string color;
  bool dashed = false;
  double width = 1.6;
};

std::vector<DrawnTrajectory> Coloured(std::vector<DrawnTrajectory> trajectories) {
  for (std::size_t k = 0; k < trajectories.size(); ++k) {
    trajectories[k].color = PlotPalette(k);
    trajectories[k].dashed = k >= kPlotPaletteSize;
  }
  return trajectories;
}

std::vector<DrawnTrajectory> DrawnFiles(const EvaluationInput& input) {
  std::vector<DrawnTrajectory> out;
  for (NamedPoseFile& file : ReadEstimates(input)) {
    DrawnTrajectory drawn;
    drawn.name = file.name;
    drawn.file = file.file;
    drawn.has_stamps = file.poses.has_stamps;
    drawn.has_rotations = HasRotations(file.poses.trajectory);
    for (const StampedPose& pose : file.poses.trajectory) {
      drawn.stamps_s.push_back(pose.stamp_s);
      drawn.poses.push_back(pose.pose);
    }
    if (drawn.poses.empty()) throw InputError(file.file + ": holds no pose");
    out.push_back(std::move(drawn));
  }
  return Coloured(std::move(out));
}

// As it was associated with the reference.
DrawnTrajectory Associated(const EvaluatedEstimate& estimate, const std::string& name,
                           const std::vector<Pose>& poses) {
  DrawnTrajectory drawn;
  drawn.name = name;
  drawn.file = estimate.file;
  drawn.has_stamps = !estimate.options.by_index;
  drawn.stamps_s = estimate.report.poses.stamps_s;
  for (double& stamp : drawn.stamps_s) stamp += estimate.options.time_offset_s;
  drawn.poses = poses;
  return drawn;
}

// The reference with the most pairs, as estimates may cover parts of it, then the estimates, aligned.
std::vector<DrawnTrajectory> DrawnEstimates(const std::vector<EvaluatedEstimate>& estimates) {
  std::vector<DrawnTrajectory> out;
  const EvaluatedEstimate* longest = &estimates.front();
  for (const EvaluatedEstimate& estimate : estimates) {
    if (estimate.report.pairs > longest->report.pairs) longest = &estimate;
    out.push_back(Associated(estimate, estimate.name, estimate.report.poses.estimate));
    out.back().has_rotations = estimate.report.rotations;
  }
  out = Coloured(std::move(out));
  DrawnTrajectory reference = Associated(*longest, "reference", longest->report.poses.reference);
  reference.color = kPlotInk;
  reference.dashed = true;
  reference.width = 2.5;
  out.insert(out.begin(), std::move(reference));
  return out;
}

TrajectoryPlot FromAbove(const std::vector<DrawnTrajectory>& trajectories) {
  TrajectoryPlot plot;
  for (const DrawnTrajectory& t : trajectories) {
    PlotSeries series{t.name, {}, t.color, t.width, t.dashed};
    for (const Pose& pose : t.poses) series.points.push_back(pose.translation);
    plot.series.push_back(std::move(series));
  }
  return plot;
}

// A line each for the three coordinates of `value(pose)` over time.
template <typename Value>
PanelPlot OverTime(const std::vector<DrawnTrajectory>& trajectories, const std::vector<std::string>& names,
                   const Value& value) {
  PanelPlot plot;
  double begin = std::numeric_limits<double>::infinity();
  bool seconds = true;
  for (const DrawnTrajectory& t : trajectories) {
    begin = std::min(begin, t.stamps_s.front());
    seconds = seconds && t.has_stamps;
  }
  plot.x_name = seconds ? "time [s]" : "frame";
  for (std::size_t axis = 0; axis < names.size(); ++axis) {
    PlotPanel panel{names[axis], {}};
    for (const DrawnTrajectory& t : trajectories) {
      PlotCurve curve{t.name, {}, t.color, t.width, t.dashed, {}};
      for (std::size_t k = 0; k < t.poses.size(); ++k)
        curve.points.emplace_back(t.stamps_s[k] - begin, value(t, k)[static_cast<Eigen::Index>(axis)]);
      panel.curves.push_back(std::move(curve));
    }
    plot.panels.push_back(std::move(panel));
  }
  return plot;
}

// The line ends where an angle goes on at the other end of the axis.
void BreakJumps(PanelPlot& plot, double jump) {
  for (PlotPanel& panel : plot.panels) {
    for (PlotCurve& curve : panel.curves) {
      std::vector<Eigen::Vector2d> points;
      for (const Eigen::Vector2d& p : curve.points) {
        if (!points.empty() && std::abs(p.y() - points.back().y()) > jump)
          points.emplace_back(p.x(), std::numeric_limits<double>::quiet_NaN());
        points.push_back(p);
      }
      curve.points = std::move(points);
    }
  }
}

PanelPlot Speeds(const std::vector<DrawnTrajectory>& trajectories) {
  for (const DrawnTrajectory& t : trajectories) {
    if (!t.has_stamps)
      throw InputError(t.file + ": has no time stamps, so no speed; give --times (KITTI: times.txt)");
  }
  return OverTime(
      trajectories, {"speed [m/s]"}, [](const DrawnTrajectory& t, std::size_t k) -> Eigen::Vector3d {
        if (k == 0) return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
        const double seconds = t.stamps_s[k] - t.stamps_s[k - 1];
        return Eigen::Vector3d::Constant((t.poses[k].translation - t.poses[k - 1].translation).norm() /
                                         seconds);
      });
}

// A plot laid out under this title, or under `otherwise` if that is empty.
template <typename Plot>
std::vector<PlotShape> Titled(Plot plot, const std::string& title, const std::string& otherwise) {
  plot.title = title.empty() ? otherwise : title;
  return LayOut(plot);
}

// "trajectory", "xyz", "rpy" or "speed". `title`: empty for one that fits.
std::vector<PlotShape> TrajectoryShapes(const std::vector<DrawnTrajectory>& trajectories,
                                        const std::string& what, const std::string& title) {
  if (what == "xyz") {
    return Titled(OverTime(trajectories, {"x [m]", "y [m]", "z [m]"},
                           [](const DrawnTrajectory& t, std::size_t k) { return t.poses[k].translation; }),
                  title, "Positions");
  }
  if (what == "rpy") {
    for (const DrawnTrajectory& t : trajectories) {
      if (!t.has_rotations)
        throw InputError(t.file + ": has positions alone, and no rotations to draw; choose --what xyz");
    }
    PanelPlot plot =
        OverTime(trajectories, {"roll [deg]", "pitch [deg]", "yaw [deg]"},
                 [](const DrawnTrajectory& t, std::size_t k) -> Eigen::Vector3d {
                   return internal::kDegrees * RollPitchYaw(t.poses[k].rotation.toRotationMatrix());
                 });
    BreakJumps(plot, 180);
    return Titled(std::move(plot), title, "Rotations");
  }
  if (what == "speed") return Titled(Speeds(trajectories), title, "Speed");
  return Titled(FromAbove(trajectories), title, "Trajectories");
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

void RequireRelativeErrors(const EvaluatedEstimate& estimate) {
  if (!estimate.report.rotations)
    throw InputError(estimate.file +
                     ": the reference or it has positions alone, which have no relative error; choose --what "
                     "error");
  if (estimate.report.rpe.count == 0)
    throw InputError(estimate.file +
                     ": no two of its poses are that far apart; choose a smaller --rpe-delta");
}

// Along the path; relative errors at the end of each pair.
CurvePlot ErrorCurves(const std::vector<EvaluatedEstimate>& estimates, bool relative) {
  CurvePlot plot;
  plot.fit = true;
  plot.x_name = "distance along the reference [m]";
  plot.y_name = "error [m]";
  for (std::size_t k = 0; k < estimates.size(); ++k) {
    const EvaluationReport& report = estimates[k].report;
    if (relative) RequireRelativeErrors(estimates[k]);
    const std::vector<double> path = Path(report);
    const double rmse = relative ? report.rpe.rmse : report.ate.rmse;
    const std::vector<double>& errors = relative ? report.relative.translation : report.absolute.translation;
    PlotCurve curve{estimates[k].name + ": rmse " + Fixed(rmse, 4) + " m",
                    {},
                    PlotPalette(k),
                    1.6,
                    k >= kPlotPaletteSize,
                    {}};
    for (std::size_t i = 0; i < (relative ? report.relative_pairs.size() : report.pairs); ++i)
      curve.points.emplace_back(path[relative ? report.relative_pairs[i].second : i], errors[i]);
    plot.curves.push_back(std::move(curve));
  }
  return plot;
}

// All estimates on one scale of colours; the reference is a thin dashed line.
TrajectoryPlot ErrorMap(const std::vector<EvaluatedEstimate>& estimates) {
  TrajectoryPlot plot = FromAbove(DrawnEstimates(estimates));
  plot.values_name = "absolute translation error [m]";
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

// "error", "rpe", "error-map", "box" or "violin".
std::vector<PlotShape> ErrorShapes(const std::vector<EvaluatedEstimate>& estimates, const std::string& what,
                                   const std::string& title) {
  const EvaluationOptions& options = estimates.front().options;
  const std::string absolute =
      std::string("Absolute translation error, alignment ") + ToString(options.alignment);
  if (what == "rpe") {
    return Titled(
        ErrorCurves(estimates, true), title,
        Formatted("Relative translation error over %g %s", options.rpe_delta, ToString(options.rpe_unit)));
  }
  if (what == "error-map") return Titled(ErrorMap(estimates), title, absolute);
  if (what == "box" || what == "violin")
    return Titled(Distributions(estimates, what == "violin"), title, absolute);
  return Titled(ErrorCurves(estimates, false), title, absolute);
}

std::vector<PlotShape> Shapes(const PlotArguments& arguments) {
  const EvaluationInput input = Resolved(arguments.input);
  CheckFiles(FilesOf(input), arguments.out);
  if (input.estimates.empty())
    throw InputError("there is no trajectory; give one or several as `tutti plot FILE...`");
  if (input.reference.empty()) {
    if (IsOfErrors(arguments.what))
      throw InputError("--what " + arguments.what + ": errors need a reference; give one with --reference");
    return TrajectoryShapes(DrawnFiles(input), arguments.what, arguments.title);
  }
  const std::vector<EvaluatedEstimate> estimates = EvaluateInput(input);
  if (IsOfErrors(arguments.what)) return ErrorShapes(estimates, arguments.what, arguments.title);
  const std::string title = arguments.title.empty() && arguments.what == "trajectory"
                                ? "Trajectories, alignment " + input.align
                                : arguments.title;
  return TrajectoryShapes(DrawnEstimates(estimates), arguments.what, title);
}

void RunPlot(const PlotArguments& arguments) {
  for (const std::string& file : arguments.out) PlotFormatOf(file);  // before the work
  const std::vector<PlotShape> shapes = Shapes(arguments);
  for (const std::string& file : arguments.out) {
    WritePlot(file, PlotFormatOf(file), shapes, arguments.font);
    std::printf("%s\n", file.c_str());
  }
}

}  // namespace

void SetUpPlot(CLI::App& command, int&) {
  const auto arguments = std::make_shared<PlotArguments>();
  arguments->input.reference_comes_first = false;
  AddEvaluationOptions(command, arguments->input);
  AddDefaulted(
      command, "--what", arguments->what,
      "trajectory: seen from above, along the two axes of largest extent; xyz, rpy, speed: over time; "
      "error: absolute translation error along the path; rpe: relative translation error, at the end "
      "of each pair; box, violin: how the absolute errors are distributed; error-map: the trajectory "
      "in the colours of its errors",
      OneOf(PlotNames()));
  command.add_option("--out", arguments->out, "Files to write; the ending is the format: .svg, .png, .pdf")
      ->required();
  command.add_option("--title", arguments->title, "Text above the plot");
  AddDefaulted(command, "--font", arguments->font.family,
               "Family of all texts, as `fc-list : family` names it; for papers: \"Times New Roman\", "
               "\"Latin Modern Roman\"");
  AddDefaulted(command, "--font-scale", arguments->font.scale, "Factor of the texts' heights",
               CLI::Range(0.25, 4.0));
  command.footer(
      R"(trajectory, xyz, rpy and speed need no reference; with one, poses are associated and aligned as `tutti evaluate`
does.
Examples:
  tutti plot a.txt b.txt --what xyz --out xyz.svg
  tutti plot a.txt b.txt --reference gt.txt --out map.svg map.pdf
  tutti plot a.txt --reference gt.txt --what error-map --out map.png
  tutti plot a.txt --reference gt.txt --what rpe --rpe-delta 10 --rpe-unit metres --out rpe.png)");
  command.callback([arguments] { RunPlot(*arguments); });
}

}  // namespace tutti::cli
