// Pixels of the same points seen from two poses, without noise.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti::testing {

struct SeenTwice {
  std::vector<cv::Point2f> first, second;
};

/// Points in front of the first camera, 4 to 12 m away; on a plane across, if flat.
inline SeenTwice SeeTwice(const PinholeCamera& first, const PinholeCamera& second, const Pose& T_second_first,
                          bool flat, std::uint32_t seed = 3) {
  std::mt19937 random(seed);
  const auto between = [&random](double low, double high) {
    return low + (high - low) * static_cast<double>(random() % 100000u) / 1e5;
  };
  SeenTwice seen;
  while (seen.first.size() < 120) {
    const double x = between(-4, 4), y = between(-3, 3), z = flat ? 6 + 0.2 * x - 0.1 * y : between(4, 12);
    const Eigen::Vector3d p(x, y, z), q = T_second_first * p;
    if (q.z() < 1) continue;
    const Eigen::Vector2d a = first.Project(p), b = second.Project(q);
    if (!first.Contains(a) || !second.Contains(b)) continue;
    seen.first.emplace_back(static_cast<float>(a.x()), static_cast<float>(a.y()));
    seen.second.emplace_back(static_cast<float>(b.x()), static_cast<float>(b.y()));
  }
  return seen;
}

}  // namespace tutti::testing
