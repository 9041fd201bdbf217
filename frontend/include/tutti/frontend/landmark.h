// What a map holds of a 3D point, and who sees it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "tutti/core/pose.h"
#include "tutti/core/shared_vector.h"

#pragma GCC visibility push(default)
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

/// The landmarks of a map by their numbers, which ascend; none is given twice. Landmarks live in chunks that
/// copies share until one writes to them, as in SharedVector; of those that are dead, Compact leaves six
/// bytes each. A run that goes round and round one place makes landmarks for ever and keeps few.
class LandmarkStore {
 public:
  int size() const { return size_; }

  /// An empty one, which is not alive, in place of one that Compact took away.
  const Landmark& operator[](int id) const {
    const Chunk& chunk = *chunks_[ChunkOf(id)];
    const int at = chunk.at[PlaceOf(id)];
    return at >= 0 ? chunk.landmarks[static_cast<std::size_t>(at)] : Gone();
  }
  /// For writing; what is written to one that Compact took away is lost. References that were got for reading
  /// show the old value if the chunk was shared.
  Landmark& Mutable(int id) {
    if (chunks_[ChunkOf(id)]->at[PlaceOf(id)] < 0) return gone_ = {};
    Chunk& chunk = Own(ChunkOf(id));
    return chunk.landmarks[static_cast<std::size_t>(chunk.at[PlaceOf(id)])];
  }
  /// References for writing stay good.
  Landmark& Append(Landmark landmark, int replaced_by = -1);

  /// The landmark that one was merged into; -1: into none.
  int ReplacedBy(int id) const { return chunks_[ChunkOf(id)]->replaced_by[PlaceOf(id)]; }
  void SetReplacedBy(int id, int other) { Own(ChunkOf(id)).replaced_by[PlaceOf(id)] = other; }

  /// Takes dead landmarks away. References to landmarks end.
  void Compact();

 private:
  static constexpr std::size_t kChunk = 64;
  struct Chunk {
    std::array<std::int16_t, kChunk> at{};  // of `landmarks`; -1: it is in none
    std::array<int, kChunk> replaced_by{};
    std::vector<Landmark> landmarks;
  };

  static std::size_t ChunkOf(int id) { return static_cast<std::size_t>(id) / kChunk; }
  static std::size_t PlaceOf(int id) { return static_cast<std::size_t>(id) % kChunk; }
  static const Landmark& Gone() {
    static const Landmark gone;
    return gone;
  }
  Chunk& Own(std::size_t c) {
    if (!internal::IsAlone(chunks_[c])) Copy(c);
    return *chunks_[c];
  }
  void Copy(std::size_t c);

  std::vector<std::shared_ptr<Chunk>> chunks_;
  int size_ = 0;
  Landmark gone_;
};

}  // namespace tutti
#pragma GCC visibility pop
