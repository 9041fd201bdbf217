// Where the frames of a run are in its map, for what draws them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>

#include "apps/run/run_result.h"

namespace tutti {

/// Positions of trajectory.txt, and of the keyframes that the map had before [m; one camera without a
/// reference: in units of the first scale], after `alignment`.
class FramePlaces {
 public:
  FramePlaces(const RunResult& result, const Similarity& alignment);

  /// Of the run's own frame with this stamp [s]; nothing if trajectory.txt has no pose for it.
  std::optional<Eigen::Vector3d> At(double stamp_s) const;
  /// Of an end of a loop: the frame has its number in the map (Loop), and a stamp of its recording.
  std::optional<Eigen::Vector3d> AtEnd(std::int64_t frame, double stamp_s) const;

 private:
  std::int64_t first_frame_ = 0;
  std::map<double, Eigen::Vector3d> own_;            // by stamp
  std::map<std::int64_t, Eigen::Vector3d> earlier_;  // by number
};

}  // namespace tutti
