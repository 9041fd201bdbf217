// Trajectories (TUM, KITTI, EuRoC) and lists of times: any bytes give finite poses in order, or an
// InputError.
#include <cmath>
#include <cstdlib>

#include "tests/fuzz/memory_file.h"
#include "tutti/core/error.h"
#include "tutti/core/trajectory.h"

namespace {

void CheckPoses(const tutti::Trajectory& trajectory) {
  const bool rotations = tutti::HasRotations(trajectory);
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    const tutti::StampedPose& pose = trajectory[i];
    const bool good = std::isfinite(pose.stamp_s) && pose.pose.translation.allFinite() &&
                      std::abs(pose.pose.rotation.norm() - (rotations ? 1.0 : 0.0)) < 1e-6;
    if (!good || (i > 0 && pose.stamp_s <= trajectory[i - 1].stamp_s)) std::abort();
  }
}

}  // namespace

// The first byte chooses the format: TUM, KITTI, EuRoC, what it looks like, the same with warnings, times.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto file = tutti::fuzz::MemoryFile(data + 1, size - 1);
  const int choice = data[0] % 6;
  try {
    if (choice == 5) {
      tutti::ReadTimes(file);
    } else if (choice == 4) {
      std::vector<std::string> warnings;
      CheckPoses(tutti::ReadTrajectory(file, tutti::GuessTrajectoryFormat(file), &warnings));
    } else if (choice == 3) {
      CheckPoses(tutti::ReadTrajectory(file, tutti::GuessTrajectoryFormat(file)));
    } else {
      CheckPoses(tutti::ReadTrajectory(file, static_cast<tutti::TrajectoryFormat>(choice)));
    }
  } catch (const tutti::InputError&) {
  }
  return 0;
}
