// Measurements of generated graphs, with noise that is the same on every platform.
#pragma once

#include <cmath>
#include <random>

#include "tutti/backend/pose_graph.h"

namespace tutti::bench {

/// Standard deviations of a relative pose.
struct Noise {
  double translation = 0;  ///< [m]
  double rotation = 0;     ///< [rad]
};

inline double Gauss(std::mt19937& random) {
  const auto uniform = [&] { return (static_cast<double>(random()) + 0.5) / 4294967296.0; };
  const double u = uniform(), v = uniform();
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * M_PI * v);
}

/// Pose of `b` in the frame of `a`, as it is measured.
inline Similarity Measured(const Similarity& a, const Similarity& b, const Noise& noise,
                           std::mt19937& random) {
  Similarity out = a.Inverse() * b;
  out.translation += noise.translation * Eigen::Vector3d(Gauss(random), Gauss(random), Gauss(random));
  out.rotation =
      out.rotation * ExpSO3(noise.rotation * Eigen::Vector3d(Gauss(random), Gauss(random), Gauss(random)));
  return out;
}

}  // namespace tutti::bench
