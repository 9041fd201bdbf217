// Least squares over a window of camera poses, landmarks and the lens's error: Levenberg-Marquardt with the
// landmarks eliminated by the Schur complement.
//
// B. Triggs et al., "Bundle adjustment: a modern synthesis", 2000, sections 6.1 and 6.2; the damping is
// H. B. Nielsen's, "Damping parameter in Marquardt's method", IMM-REP-1999-05. One thread, fixed order of
// summation: the same input gives the same bits.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <optional>
#include <vector>

#include "frontend/geometry/lens_error.h"
#include "frontend/geometry/pose_solver.h"
#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti {

/// A landmark as one camera of the window sees it; the point in `measured` is not used.
struct WindowObservation {
  int camera = 0;
  PointObservation measured;
};

/// Unknowns with their start values, and what was measured.
struct Window {
  std::vector<Pose> T_camera_world;             ///< the `moving` ones first, then the fixed
  int moving = 0;                               ///< cameras that are adjusted
  std::vector<Eigen::Vector3d> points;          ///< in the world; the fixed ones first
  std::size_t fixed_points = 0;                 ///< points that are not adjusted
  std::vector<WindowObservation> observations;  ///< those of point 0, of point 1, ...
  std::vector<std::size_t> first_observation;   ///< of each point, and their number at the end
  LensError lens;                               ///< in: what is known of it; out: with what the window says
};

struct WindowReport {
  bool usable = false;
  int iterations = 0;
  double initial_cost = 0, final_cost = 0;  ///< half the sum of the Huber-robust squared residuals
};

/// Minimises the Huber-robust reprojection error over moving poses, points and lens. Ends after the iteration
/// in which `stop` becomes true; null: never.
WindowReport SolveWindow(const PinholeCamera& camera, int max_iterations, Window* window,
                         const std::atomic<bool>* stop = nullptr);

/// What a solved window alone says of the lens, without `window.lens.information`. Every pose is free but the
/// gauge: fixed poses were found with the lens as it was believed to be then, and taken as certain they would
/// say that it was right. So straight motion at an even pace says little, because a drift of the scale looks
/// the same. None if the window has fewer than two cameras or leaves the lens open.
std::optional<LensError> ObserveLens(const PinholeCamera& camera, const Window& window);

}  // namespace tutti
