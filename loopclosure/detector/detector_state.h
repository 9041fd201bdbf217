// What a detector knows of the images that it was shown.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/numbers.h"
#include "loopclosure/detector/ensemble.h"
#include "loopclosure/detector/place_reasoner.h"
#include "loopclosure/geometry/verification.h"
#include "loopclosure/store/location_store.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// Members with their vocabularies, the memories and filters, and a view of every location in memory. What a
/// store or a file holds besides is theirs. Locations are slots: 0, 1, 2, ... in the order of adding.
class DetectorState {
 public:
  /// Empty. Throws InputError if the options are not usable.
  explicit DetectorState(const LoopDetectorOptions& options)
      : options_(options), ensemble_(options_), reasoner_(options_, ensemble_.members()) {}
  DetectorState(const DetectorState&) = delete;  // the parts refer to each other
  DetectorState& operator=(const DetectorState&) = delete;

  const LoopDetectorOptions& options() const { return options_; }
  Ensemble& ensemble() { return ensemble_; }
  const Ensemble& ensemble() const { return ensemble_; }
  const std::vector<Member>& members() const { return ensemble_.members(); }
  PlaceReasoner& reasoner() { return reasoner_; }
  const PlaceReasoner& reasoner() const { return reasoner_; }
  /// All locations: those of the shared memory, or what is in any member's.
  const LocationMemory& memory() const { return reasoner_.memory(); }
  /// Id of the newest query, -1 if there was none.
  std::int64_t last_id() const { return last_id_; }
  const CallersDescriptors& callers_descriptors() const { return callers_descriptors_; }

  /// Steps 3 and 4 of loop-closure.md section 1: the query becomes a location. Returns its view, which holds
  /// until the next call, even if the location has just been merged into an older one.
  const View& Remember(const LoopQuery& query, View view, const std::vector<SeenWords>& words);

  /// False for a location that is in no memory.
  bool HasView(int slot) const { return Index(slot) < views_.size() && !views_[Index(slot)].members.empty(); }
  /// What geometry needs of a location; empty if it is in no memory.
  const View& view(int slot) const { return views_[Index(slot)]; }
  /// The location has left all memories.
  void DropView(int slot) { At(slot) = View(); }
  /// Stands in for a view that is lost: the location is known, but can't be verified.
  void PutViewWithoutFeatures(int slot);
  /// Takes up a view that was saved. Throws InputError, with the name of the source, if it is not of this
  /// location, or of other members.
  void LoadView(int slot, View view, const std::string& source);
  /// The view of a location that is in no memory, as the store has it. Throws InputError.
  View StoredView(int slot, LocationStore& store) const;
  /// Puts a location's view into the store, and takes it up from there. Throws InputError.
  void StoreView(int slot, LocationStore& store) const;
  void FetchView(int slot, LocationStore& store);

  /// Running figures: all but vocabularies, memories, filters and views.
  template <class Archive>
  void State(Archive& archive) {
    archive(last_id_, callers_descriptors_.type, callers_descriptors_.width);
    if constexpr (Archive::kReading) {
      const int type = callers_descriptors_.type;
      if (last_id_ < -1 || (type != -1 && type != CV_8U && type != CV_32F))
        archive.Damaged("the detector's statistics");
    }
    for (Member& member : ensemble_.members()) archive(member);
    archive(reasoner_);
  }
  /// After loading: throws InputError, with the name of the source, if the memories are not about the same
  /// locations, or the last one is not last_id().
  void CheckMemories(const std::string& source) const;

 private:
  View& At(int slot);

  LoopDetectorOptions options_;
  Ensemble ensemble_;
  PlaceReasoner reasoner_;
  std::vector<View> views_;  // by slot; empty where the location is in no memory
  View merged_view_;         // of a query that rehearsal has just merged away
  std::int64_t last_id_ = -1;
  CallersDescriptors callers_descriptors_;
};

}  // namespace tutti::internal
