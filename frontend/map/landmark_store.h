// The landmarks of a map by their numbers. Copies share what is the same in both.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "frontend/map/landmark.h"
#include "frontend/map/shared_vector.h"

namespace tutti {

/// Numbers ascend and none is given twice. Landmarks live in chunks that copies share until one writes to
/// them, as in SharedVector; of those that are dead, Compact leaves six bytes each. A run that goes round
/// and round one place makes landmarks for ever and keeps few.
class LandmarkStore {
 public:
  int size() const { return size_; }

  /// Of one that Compact took away: an empty one, which is not alive.
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
