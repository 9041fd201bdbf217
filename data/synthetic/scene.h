// The things in the synthetic world, and the way through them.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "data/synthetic/rasterizer.h"
#include "data/synthetic/synthetic_options.h"

namespace tutti::synthetic {

/// A closed way with a time table. Plane coordinates [m]; z is up.
class Route {
 public:
  /// `points`: closed polyline, one point every `step_m` metres; speeds are limited by the yaw rate in curves
  /// and by the acceleration between them.
  Route(std::vector<Eigen::Vector2d> points, double speed_mps, double max_yaw_rate, double max_acceleration);
  double Length() const { return length_; }        ///< of one lap [m]
  double LapTime() const { return time_.back(); }  ///< [s]
  /// Way gone after a time, laps included [m].
  double DistanceAt(double time_s) const;
  Eigen::Vector2d PointAt(double distance_m) const;
  /// Direction of the way, as an angle from x [rad].
  double HeadingAt(double distance_m) const;

 private:
  std::vector<Eigen::Vector2d> points_;
  std::vector<double> time_;  ///< at each point, and at the end of the lap
  double step_ = 0, length_ = 0;
};

/// A place beside the road where another car is parked when the camera comes again.
struct ParkingPlace {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();
  std::size_t first_face = 0, faces = 0;  ///< of Scene::faces: the first lap's car; 0 faces: none
  std::vector<Face> later;                ///< the next one; empty: none
};

/// Everything that can be seen, and the camera's way. Frame of reference: x, y on the ground, z up [m].
struct Scene {
  std::vector<Texture> textures;
  std::vector<Face> faces;
  std::vector<BoxTextures> movers;     ///< looks of the moving objects
  std::vector<BoxTextures> lorries;    ///< looks of what drives near the camera (occlusion)
  std::vector<ParkingPlace> parking;   ///< those that change (other_cars)
  std::vector<Eigen::Vector3d> lamps;  ///< street lamps, lit at dusk
  Eigen::Vector3d mover_size = Eigen::Vector3d(4.2, 1.75, 1.4);
  double mover_left = 3.2;    ///< they keep this far to the left of the camera's way [m]
  double mover_speed = -6;    ///< along the way; negative: oncoming [m/s]
  std::vector<Route> routes;  ///< exactly one
  double eye_height = 1.65;   ///< [m]
  double gaze_right = 0;      ///< the camera looks so far to the right of the way [rad],
  double gaze_down = 0;       ///< and down [rad]
  double sway = 0.006;        ///< amplitude of its rolling and pitching [rad]

  int Add(const cv::Mat& texture) {
    textures.emplace_back(texture);
    return static_cast<int>(textures.size()) - 1;
  }
};

/// Closed polyline -> evenly spaced points, corners rounded by two moving averages of `rounding_m`.
std::vector<Eigen::Vector2d> SmoothLoop(const std::vector<Eigen::Vector2d>& corners, double step_m,
                                        double rounding_m);

Scene BuildTown(const SyntheticOptions& options);
Scene BuildCorridor(const SyntheticOptions& options);
Scene BuildRoom(const SyntheticOptions& options);
/// A room or hall (options.scene) around a way of cameras, which no wall and nothing in it is near to.
Scene BuildSpaceAround(const SyntheticOptions& options, const std::vector<Eigen::Vector3d>& way);

}  // namespace tutti::synthetic
