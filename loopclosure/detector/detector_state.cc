#include "loopclosure/detector/detector_state.h"

#include <utility>

#include "core/byte_stream.h"
#include "loopclosure/geometry/view_bytes.h"
#include "tutti/core/error.h"

namespace tutti::internal {

using Kind = LocationStore::Kind;
using State = LocationMemory::State;

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
  ByteWriter record;
  SaveView(view(slot), record);
  store.Put(Kind::kView, 0, slot, record.bytes());
}

View DetectorState::StoredView(int slot, LocationStore& store) const {
  const auto record = store.Get(Kind::kView, 0, slot);
  if (!record) {
    throw InputError(store.name() + ": is damaged (the features of location " +
                     std::to_string(memory().id(slot)) +
                     " are missing); give another file, or an older copy");
  }
  ByteReader in(*record, store.name());
  return internal::LoadView(in);
}

void DetectorState::FetchView(int slot, LocationStore& store) {
  LoadView(slot, StoredView(slot, store), store.name());
}

std::string DetectorState::Statistics() const {
  ByteWriter out;
  out.Put(last_id_);
  out.Put<std::int32_t>(callers_descriptors_.type);
  out.Put<std::int32_t>(callers_descriptors_.width);
  for (const Member& member : members()) member.SaveStatistics(out);
  reasoner_.SaveStatistics(out);
  return out.bytes();
}

void DetectorState::LoadStatistics(ByteReader& in) {
  last_id_ = in.Get<std::int64_t>();
  callers_descriptors_.type = in.Get<std::int32_t>();
  callers_descriptors_.width = in.Get<std::int32_t>();
  const int type = callers_descriptors_.type;
  if (last_id_ < -1 || (type != -1 && type != CV_8U && type != CV_32F)) {
    in.Damaged("the detector's statistics");
  }
  for (Member& member : ensemble_.members()) member.LoadStatistics(in);
  reasoner_.LoadStatistics(in);
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
    const State state = memory().state(slot);
    if (reasoner_.InMemory(slot) != (state == State::kShortTerm || state == State::kWorking)) {
      in.Damaged("a location that is in no memory");
    }
  }
}

}  // namespace tutti::internal
