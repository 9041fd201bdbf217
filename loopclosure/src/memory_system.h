// One memory and the filters that work on it: the shared one, or a member's own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "byte_stream.h"
#include "location_store.h"
#include "tutti/loopclosure/bayes_filter.h"
#include "tutti/loopclosure/detector_options.h"
#include "tutti/loopclosure/likelihood.h"
#include "tutti/loopclosure/location_memory.h"
#include "tutti/loopclosure/member.h"
#include "tutti/loopclosure/signature.h"
#include "tutti/loopclosure/transition_model.h"

namespace tutti::internal {

/// Records of a memory's nodes under its number, and all of them back again, slots ascending. LoadNodes
/// throws InputError.
void StoreNodes(const LocationMemory& memory, int number, const std::set<int>& slots, LocationStore& store);
void LoadNodes(int number, LocationStore& store, LocationMemory& memory);
/// Record of a word of a member (its number), which must be in the vocabulary.
void StoreWord(const Vocabulary& vocabulary, std::size_t member, int word, LocationStore& store);

/// One Bayes filter and the members whose signatures it sees: one each for mean, product, majority and
/// single; all of them, concatenated, for naive (loop-closure.md eq. 3).
struct FilterUnit {
  FilterUnit(std::vector<std::size_t> sources, LikelihoodKind kind)
      : members(std::move(sources)), likelihood(kind) {}
  std::vector<std::size_t> members;
  LikelihoodModel likelihood;
  BayesFilter filter;
  Signature signature;         ///< of the present image, empty if bad
  Belief image_likelihood;     ///< of the present image
  std::vector<double> scores;  ///< raw ones behind it, by slot; only with keep_evidence
  double agreement = 1.0;      ///< running share of the verified loops that it had found, 0..1
  bool took_part() const { return !signature.empty(); }
};

/// Steps 3 to 5, 7 and 8 of loop-closure.md section 1. Slots are the same in every memory of one detector.
class MemorySystem {
 public:
  /// `members` are all of the detector's; `units` says which of them each filter of this memory sees.
  /// `number` is the memory's own in the store.
  MemorySystem(int number, const LoopDetectorOptions& options,
               const std::vector<std::vector<std::size_t>>& units, std::vector<Member>& members);

  /// Steps 3 and 4: a new location with these signatures (one per member of the detector) enters STM, is
  /// rehearsed, and the oldest of STM go to WM. Returns the slot that now stands for the image.
  int Remember(std::int64_t id, const std::vector<Signature>& signatures);

  /// Step 5. Different units may run at the same time.
  void UpdateLikelihood(std::size_t unit);
  void StepFilter(std::size_t unit);

  /// What a unit believes of an image with these signatures that is no location: its likelihood, normalised.
  /// Of a unit without words of it, no places.
  Belief Opinion(std::size_t unit, const std::vector<Signature>& signatures) const;

  /// A loop with this location was verified: which filters had it?
  void Agree(int location);
  /// The newer location closes a loop with the older one.
  void CloseLoop(int newer, int older);
  void AddLink(int a, int b);

  /// Step 7: brings locations near `best` back from LTM. Returns their slots. One that can't be read stays
  /// where it is, and `warning` says so.
  std::vector<int> Retrieve(int best, LocationStore& store, std::string& warning);

  /// Step 8: the next one to go, -1: none. `best` and what is near it stay, and `retrieved`.
  int NextToTransfer(int best, const std::vector<int>& retrieved) const;
  /// What a location would leave with: its signatures, and descriptors of the words that leave with it.
  void Store(int slot, LocationStore& store) const;
  /// It leaves WM.
  void Leave(int slot);

  /// For a durable store: signatures of a new location; then all nodes that changed since the last time.
  void StoreSignatures(int slot, LocationStore& store) const;
  /// Takes up what a durable store holds: nodes first, then signatures of all in STM and WM, with their
  /// words.
  void Reopen(LocationStore& store);

  void Save(ByteWriter& out) const;
  void Load(ByteReader& in);

  LocationMemory& memory() { return memory_; }
  const LocationMemory& memory() const { return memory_; }
  std::vector<FilterUnit>& units() { return units_; }
  const std::vector<FilterUnit>& units() const { return units_; }

 private:
  // One record holds the signatures of every unit.
  std::string Record(int slot) const;
  std::vector<Signature> ReadRecord(std::string_view record, const std::string& source) const;
  void Restore(int slot, LocationStore& store);
  void ReadWord(std::size_t member, int word, LocationStore& store, cv::Mat& descriptors) const;
  void Reference(const FilterUnit& unit, const Signature& signature);
  void Release(const FilterUnit& unit, const Signature& signature);
  bool LooksLikePrevious(int slot) const;
  void Link(int a, int b, LocationMemory::LinkType type);

  int number_;
  const LoopDetectorOptions& options_;
  std::vector<Member>& members_;
  std::vector<FilterUnit> units_;
  LocationMemory memory_;
  TransitionModel transition_;
};

}  // namespace tutti::internal
