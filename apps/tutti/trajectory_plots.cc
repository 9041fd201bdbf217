// Where trajectories lead: from above, and over time.
#include "apps/tutti/trajectory_plots.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "apps/plot/plot.h"
#include "apps/plot/plot_panels.h"
#include "core/numbers.h"
#include "tutti/backend/trajectory_file.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

std::vector<DrawnTrajectory> Coloured(std::vector<DrawnTrajectory> trajectories) {
  for (std::size_t k = 0; k < trajectories.size(); ++k) {
    trajectories[k].color = PlotPalette(k);
    trajectories[k].dashed = k >= kPlotPaletteSize;
  }
  return trajectories;
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

/// A line each for the three coordinates of `value(pose)` over time.
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

/// The line ends where an angle goes on at the other end of the axis.
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
  PanelPlot plot =
      OverTime(trajectories, {"speed [m/s]"}, [](const DrawnTrajectory& t, std::size_t k) -> Eigen::Vector3d {
        if (k == 0) return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
        const double seconds = t.stamps_s[k] - t.stamps_s[k - 1];
        return Eigen::Vector3d::Constant((t.poses[k].translation - t.poses[k - 1].translation).norm() /
                                         seconds);
      });
  return plot;
}

}  // namespace

const std::vector<std::string>& PlotNames() {
  static const std::vector<std::string> names = {"trajectory", "xyz", "rpy",    "speed",    "error",
                                                 "rpe",        "box", "violin", "error-map"};
  return names;
}

bool IsOfErrors(const std::string& what) {
  return what != "trajectory" && what != "xyz" && what != "rpy" && what != "speed";
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

std::vector<DrawnTrajectory> DrawnEstimates(const std::vector<EvaluatedEstimate>& estimates) {
  std::vector<DrawnTrajectory> out;
  // The longest of the references, as estimates may cover parts of it.
  const EvaluatedEstimate* longest = &estimates.front();
  for (const EvaluatedEstimate& estimate : estimates) {
    if (estimate.report.pairs > longest->report.pairs) longest = &estimate;
    DrawnTrajectory drawn;
    drawn.name = estimate.name;
    drawn.file = estimate.file;
    drawn.has_stamps = !estimate.options.by_index;
    drawn.has_rotations = estimate.report.rotations;
    drawn.stamps_s = estimate.report.poses.stamps_s;
    for (double& stamp : drawn.stamps_s) stamp += estimate.options.time_offset_s;
    drawn.poses = estimate.report.poses.estimate;
    out.push_back(std::move(drawn));
  }
  out = Coloured(std::move(out));
  DrawnTrajectory reference;
  reference.name = "reference";
  reference.file = longest->file;
  reference.has_stamps = !longest->options.by_index;
  reference.stamps_s = longest->report.poses.stamps_s;
  for (double& stamp : reference.stamps_s) stamp += longest->options.time_offset_s;
  reference.poses = longest->report.poses.reference;
  reference.color = kPlotInk;
  reference.dashed = true;
  reference.width = 2.5;
  out.insert(out.begin(), std::move(reference));
  return out;
}

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

}  // namespace tutti::cli
