// What a map holds of a 3D point, and who sees it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "tutti/core/pose.h"

namespace tutti {

/// Feature `feature` of keyframe `keyframe` sees a landmark.
struct Observation {
  int keyframe = -1;
  int feature = -1;

  template <class Archive>
  void State(Archive& archive) {
    archive(keyframe, feature);
  }
};

/// What a landmark looks like in the keyframe that made it, at the pyramid level of its corner.
struct Patch {
  static constexpr int kHalf = 8;  // [px of the level]
  static constexpr int kSide = 2 * kHalf + 1;
  std::array<std::uint8_t, kSide * kSide> grey{};
  float offset_x = 0, offset_y = 0;  ///< of the landmark from the patch's centre [px of the level]
  float scale_x = 1, scale_y = 1;    ///< level-0 pixels per pixel of the level

  /// All but `grey`: those of many landmarks are saved as one image.
  template <class Archive>
  void State(Archive& archive) {
    archive(offset_x, offset_y, scale_x, scale_y);
  }
};

/// A 3D point.
struct Landmark {
  bool alive = false;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in the world [m]
  Eigen::Vector3d normal =
      Eigen::Vector3d::Zero();               ///< mean viewing direction (unit), from the cameras to the point
  float min_distance = 0, max_distance = 0;  ///< distances at which its corner can be detected [m]
  std::array<std::uint8_t, 32> descriptor{};  ///< the most central of its descriptors
  std::vector<Observation> observations;      ///< ascending by keyframe; one per keyframe at most
  int reference = -1;                         ///< keyframe that made it
  std::shared_ptr<const Patch> patch;         ///< null if there was no image
  Observation patch_source;                   ///< what the patch is of
  int visible = 0, found = 0;                 ///< frames that should see it, and that did

  /// All but `alive`, and `descriptor`, which is a keyframe's as a rule.
  template <class Archive>
  void State(Archive& archive) {
    std::optional<Patch> own;
    if (patch) own = *patch;
    archive(position, normal, min_distance, max_distance, observations, reference, own, patch_source, visible,
            found);
    if (Archive::kReading && own) patch = std::make_shared<const Patch>(*own);
  }
};

}  // namespace tutti
