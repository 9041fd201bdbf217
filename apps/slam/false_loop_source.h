// False loops on purpose (run.inject_false_loops): does the back end keep them out?
#pragma once

#include <cstdint>
#include <optional>
#include <random>

#include "tutti/frontend/odometry.h"
#include "tutti/slam/loop_record.h"
#include "tutti/slam/slam_options.h"

namespace tutti {

/// Makes loops that look verified and are wrong, in turn: a random relative pose; a wrong place taken for the
/// same one; and one that agrees with the false loop before it through the odometry, as loops between two
/// corridors that look alike do. They carry the information of a good loop. Deterministic by seed and
/// keyframes.
class FalseLoopSource {
 public:
  FalseLoopSource(const SlamOptions& options, std::uint64_t seed)
      : options_(options), left_(options.inject_false_loops), random_(seed) {}

  int left() const { return left_; }
  /// A false loop to the keyframe `query`, or to any if it is negative; nothing if none are left or the map
  /// is too small yet.
  std::optional<LoopEdge> Next(const Odometry& odometry, int query);

 private:
  double Symmetric(double limit);
  Similarity Draw(double length, double angle_rad);
  std::optional<LoopEdge> Alike(const Odometry& odometry, const std::vector<int>& ids) const;
  Matrix7d Information(double depth) const;

  SlamOptions options_;
  int left_;
  int made_ = 0;
  std::mt19937_64 random_;
  std::optional<LoopEdge> last_;
};

}  // namespace tutti
