// Where locations go that leave memory, and where they come back from.
#pragma once

#include <memory>

#include "loopclosure/detector/detector_state.h"
#include "loopclosure/detector/journal.h"
#include "loopclosure/store/location_store.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// Steps 7 and 8 of loop-closure.md section 1, and the store that they use: a temporary one, made when it is
/// needed, or options.ltm_file. A store that fails is a warning in the result, and nothing is lost.
class LongTermMemory {
 public:
  /// `state` must outlive this object and stay where it is. Opens nothing.
  explicit LongTermMemory(DetectorState& state) : state_(state), journal_(state) {}

  /// Opens options.ltm_file, if there is one, and takes up what it holds. Throws InputError.
  void Open();
  /// If `other` has a file, puts all that is known into it, in place of what it holds, and goes on with it;
  /// `other` is left with the store of this object. Throws InputError: then it keeps what it had.
  void TakeFile(LongTermMemory& other);

  /// Step 7: locations near `best` (a slot, -1: none) come back.
  void Retrieve(int best, LoopResult& result);
  /// Step 8: locations leave where working memory is too large, or `elapsed_ms` over the budget.
  void Shrink(int best, double elapsed_ms, LoopResult& result);
  /// The file learns of the newest image and all that it has changed.
  void Record(LoopResult& result);

  /// What geometry needs of a location that has left. Throws InputError.
  View ViewOf(int slot) { return state_.StoredView(slot, store()); }

  /// The store, which is made if there is none.
  LocationStore& store();
  /// True if something may have left: there is a store.
  bool has_store() const { return store_ != nullptr; }

 private:
  bool Transfer(MemorySystem& system, int slot, LoopResult& result);

  DetectorState& state_;
  Journal journal_;
  std::unique_ptr<LocationStore> store_;
};

}  // namespace tutti::internal
