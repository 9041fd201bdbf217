#include "frontend/map/landmark_store.h"

#include <algorithm>

namespace tutti {

Landmark& LandmarkStore::Append(Landmark landmark, int replaced_by) {
  const std::size_t c = ChunkOf(size_), place = PlaceOf(size_);
  if (place == 0) {
    chunks_.push_back(std::make_shared<Chunk>());
    chunks_.back()->at.fill(-1);
    chunks_.back()->landmarks.reserve(kChunk);
  }
  Chunk& chunk = Own(c);
  ++size_;
  chunk.replaced_by[place] = replaced_by;
  if (!landmark.alive) return gone_ = {};
  chunk.at[place] = static_cast<std::int16_t>(chunk.landmarks.size());
  return chunk.landmarks.emplace_back(std::move(landmark));
}

void LandmarkStore::Copy(std::size_t c) {
  auto copy = std::make_shared<Chunk>();
  copy->at = chunks_[c]->at;
  copy->replaced_by = chunks_[c]->replaced_by;
  if (c + 1 == chunks_.size()) copy->landmarks.reserve(kChunk);  // references stay good while it grows
  copy->landmarks.insert(copy->landmarks.end(), chunks_[c]->landmarks.begin(), chunks_[c]->landmarks.end());
  chunks_[c] = std::move(copy);
}

void LandmarkStore::Compact() {
  const auto is_alive = [](const Landmark& landmark) { return landmark.alive; };
  for (std::size_t c = 0; (c + 1) * kChunk <= static_cast<std::size_t>(size_); ++c) {  // the last one grows
    const std::vector<Landmark>& before = chunks_[c]->landmarks;
    const auto alive = std::count_if(before.begin(), before.end(), is_alive);
    if (static_cast<std::size_t>(alive) == before.size()) continue;
    auto kept = std::make_shared<Chunk>();
    kept->at.fill(-1);
    kept->replaced_by = chunks_[c]->replaced_by;
    kept->landmarks.reserve(static_cast<std::size_t>(alive));
    for (std::size_t place = 0; place < kChunk; ++place) {
      const int at = chunks_[c]->at[place];
      if (at < 0 || !before[static_cast<std::size_t>(at)].alive) continue;
      kept->at[place] = static_cast<std::int16_t>(kept->landmarks.size());
      kept->landmarks.push_back(before[static_cast<std::size_t>(at)]);
    }
    chunks_[c] = std::move(kept);
  }
}

}  // namespace tutti
