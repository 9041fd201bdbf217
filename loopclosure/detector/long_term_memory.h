// Where locations go that leave memory, and where they come back from; and the file that outlives the
// process.
#pragma once

#include <memory>
#include <set>
#include <vector>

#include "loopclosure/detector/detector_state.h"
#include "loopclosure/store/location_store.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// What a durable store has still to learn. Every write is one step: the store has all of it, or what it had
/// before.
class Journal {
 public:
  /// `state` must outlive this object and stay where it is.
  explicit Journal(DetectorState& state);

  /// Notes the newest location and every node that has changed since the last call.
  void Note();
  /// False for a location that was noted and is not in the store yet.
  bool Holds(int slot) const { return slots_.count(slot) == 0; }
  /// Puts all that was noted into the store; then nothing is left to learn. Throws InputError: then the next
  /// call tries again.
  void Write(LocationStore& store);
  /// Nothing is left to learn: there is no store that wants to know.
  void Clear();

  /// Puts all that the detector knows into the store in place of what it holds, with the long-term memory of
  /// another one (nullptr: none). Throws InputError.
  void Rewrite(LocationStore& store, LocationStore* long_term);
  /// Into an empty detector: takes up what the store holds; a new store is marked as this configuration's.
  /// Throws InputError if it belongs to another one, or is damaged.
  void Reopen(LocationStore& store);

 private:
  void PutNoted(LocationStore& store) const;
  void PutWords(LocationStore& store) const;
  std::vector<LocationMemory*> Memories() const;

  DetectorState& state_;
  std::set<int> slots_;               // whose signatures and view are new
  std::vector<std::set<int>> nodes_;  // by memory: those of the systems, then of what is in any of them
  std::vector<int> stored_words_;     // by member: words below this are stored
};

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
