#include "loopclosure/detector/detector_state.h"

#include <utility>

#include "core/byte_stream.h"
#include "core/state_archive.h"
#include "tutti/core/error.h"

namespace tutti::internal {

using Kind = LocationStore::Kind;

const View& DetectorState::Remember(const LoopQuery& query, View view, const std::vector<SeenWords>& words) {
  last_id_ = query.id;
  if (query.features.descriptors.rows > 0) {
    callers_descriptors_ = {query.features.descriptors.type(), query.features.descriptors.cols};
  }
  const int newest = memory().size();
  const int stands_for = reasoner_.Remember(query.id, words, query.pose_prior);
  return (stands_for == newest ? At(newest) : merged_view_) = std::move(view);
}

// Grows with the memory: views are loaded before anything is remembered.
View& DetectorState::At(int slot) {
  views_.resize(Index(memory().size()));
  return views_[Index(slot)];
}

void DetectorState::PutViewWithoutFeatures(int slot) {
  View& view = At(slot);
  view = View();
  view.id = memory().id(slot);
  view.size = {1, 1};
  view.members.resize(members().size());
}

void DetectorState::LoadView(int slot, View view, const std::string& source) {
  const ByteReader in("", source);
  if (view.id != memory().id(slot)) in.Damaged("features of another location");
  if (view.members.size() != members().size()) in.Damaged("features of other members");
  const PackedMat& own = view.caller.descriptors;
  if (!own.empty() && (own.type() != callers_descriptors_.type || own.cols() != callers_descriptors_.width)) {
    in.Damaged("features of another kind");
  }
  At(slot) = std::move(view);
}

void DetectorState::StoreView(int slot, LocationStore& store) const {
  store.Put(Kind::kView, 0, slot, StateBytes(view(slot)));
}

View DetectorState::StoredView(int slot, LocationStore& store) const {
  const auto record = store.Get(Kind::kView, 0, slot);
  if (!record) {
    store.Damaged("the features of location " + std::to_string(memory().id(slot)) + " are missing");
  }
  View view;
  ReadStateBytes(*record, store.name(), view);
  return view;
}

void DetectorState::FetchView(int slot, LocationStore& store) {
  LoadView(slot, StoredView(slot, store), store.name());
}

void DetectorState::CheckMemories(const std::string& source) const {
  const ByteReader in("", source);
  const int size = memory().size();
  const std::int64_t newest = size > 0 ? memory().id(size - 1) : -1;
  if (newest != last_id_) in.Damaged("the last location is missing");
  for (const auto& system : reasoner_.systems()) {
    if (system->memory().size() != size) in.Damaged("the memories are of different lengths");
    for (int slot = 0; slot < size; ++slot) {
      if (system->memory().id(slot) != memory().id(slot)) in.Damaged("memories of different locations");
    }
  }
  for (int slot = 0; slot < size; ++slot) {
    if (reasoner_.InMemory(slot) != memory().Holds(slot)) {
      in.Damaged("a location that is in no memory");
    }
  }
}

}  // namespace tutti::internal
