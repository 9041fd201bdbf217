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

/// z is drawn first: in the arguments of one call, which comes first would be the compiler's choice.
inline Eigen::Vector3d GaussVector(std::mt19937& random) {
  const double z = Gauss(random), y = Gauss(random), x = Gauss(random);
  return {x, y, z};
}

/// Pose of `b` in the frame of `a`, as it is measured.
inline Similarity Measured(const Similarity& a, const Similarity& b, const Noise& noise,
                           std::mt19937& random) {
  Similarity out = a.Inverse() * b;
  out.translation += noise.translation * GaussVector(random);
  out.rotation = out.rotation * ExpSO3(noise.rotation * GaussVector(random));
  return out;
}

}  // namespace tutti::bench
