// Keeps a store that outlives the process up to date with a detector, and makes a detector of it again.
#pragma once

#include <set>
#include <vector>

#include "loopclosure/detector/detector_state.h"
#include "loopclosure/store/location_store.h"

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

}  // namespace tutti::internal
