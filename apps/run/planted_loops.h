// False loops on purpose (run.inject_false_loops): does the back end keep them out?
#pragma once

#include <cstdint>

#include "tutti/slam/slam_system.h"

namespace tutti {

/// Plants loops that look verified and are wrong into a run (backend/graph/false_loops.h): one with every
/// third keyframe, in turn a random relative pose, a wrong place taken for the same one, and two that agree
/// with each other, as loops between two corridors that look alike do; as certain as the detector's are. The
/// same run and seed give the same loops.
class PlantedLoops {
 public:
  PlantedLoops(const SlamOptions& options, std::uint64_t seed)
      : left_(options.inject_false_loops), seed_(seed) {}

  /// After each frame that became a keyframe.
  void OnKeyframe(int keyframe, SlamSystem* slam);
  /// After SlamSystem::Finish: those that are left, anywhere.
  void PlantRest(SlamSystem* slam);

  /// For checkpoints.
  template <class Archive>
  void State(Archive& archive) {
    archive(left_, made_, keyframes_);
  }

 private:
  bool Plant(int newest, SlamSystem* slam);

  int left_;
  std::uint64_t seed_;
  int made_ = 0;
  int keyframes_ = 0;
};

}  // namespace tutti
