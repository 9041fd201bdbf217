// The plots of `tutti plot`.
#pragma once

#include <string>
#include <vector>

#include "apps/plot/plot_shapes.h"
#include "apps/tutti/evaluation_input.h"

namespace tutti::cli {

/// What can be drawn, in the order of the help.
const std::vector<std::string>& PlotNames();
/// Errors, which need a reference; the others need none.
bool IsOfErrors(const std::string& what);

/// A trajectory as it is drawn: as the file has it, or associated and aligned.
struct DrawnTrajectory {
  std::string name, file;
  std::vector<double> stamps_s;  ///< frame numbers where there are no stamps
  bool has_stamps = true, has_rotations = true;
  std::vector<Pose> poses;
  std::string color;
  bool dashed = false;
  double width = 1.6;
};

/// Files alone.
std::vector<DrawnTrajectory> DrawnFiles(const EvaluationInput& input);
/// The reference with the most pairs, then the estimates, aligned.
std::vector<DrawnTrajectory> DrawnEstimates(const std::vector<EvaluatedEstimate>& estimates);

/// "trajectory", "xyz", "rpy" or "speed". `title`: empty for one that fits. Throws InputError that names a
/// file without time stamps if they are needed.
std::vector<PlotShape> TrajectoryShapes(const std::vector<DrawnTrajectory>& trajectories,
                                        const std::string& what, const std::string& title);
/// "error", "rpe", "error-map", "box" or "violin". Throws InputError that names a file without relative
/// errors.
std::vector<PlotShape> ErrorShapes(const std::vector<EvaluatedEstimate>& estimates, const std::string& what,
                                   const std::string& title);

/// A plot laid out under this title, or under `otherwise` if that is empty.
template <typename Plot>
std::vector<PlotShape> Titled(Plot plot, const std::string& title, const std::string& otherwise) {
  plot.title = title.empty() ? otherwise : title;
  return LayOut(plot);
}

}  // namespace tutti::cli
