// One memory and the filters that work on it: the shared one, or a member's own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/state_archive.h"
#include "loopclosure/filter/alias_evidence.h"
#include "loopclosure/filter/bayes_filter.h"
#include "loopclosure/filter/transition_model.h"
#include "loopclosure/memory/dense_model.h"
#include "loopclosure/memory/likelihood.h"
#include "loopclosure/memory/location_memory.h"
#include "loopclosure/memory/member.h"
#include "loopclosure/store/location_store.h"
#include "loopclosure/vocabulary/signature.h"
#include "tutti/loopclosure/detector_options.h"

namespace tutti::internal {

/// Records of a memory's nodes under its number, and all of them back again, slots ascending. LoadNodes
/// throws InputError.
void StoreNodes(LocationMemory& memory, int number, const std::set<int>& slots, LocationStore& store);
void LoadNodes(int number, LocationStore& store, LocationMemory& memory);
/// Record of a word of a member (its number), which must be in the vocabulary.
void StoreWord(const Vocabulary& vocabulary, std::size_t member, int word, LocationStore& store);

/// What every image in turn says of the places, and what is believed after it.
struct PlaceFilter {
  explicit PlaceFilter(const EvidenceOptions& options) : alias(options) {}
  std::vector<double> counts;  ///< of the present image, by slot; counts alone
  AliasEvidence alias;         ///< what they are worth
  Belief image_likelihood;     ///< of the present image
  BayesFilter filter;
};

/// What a unit keeps of a location: its words, or the descriptor of a dense member.
struct UnitRecord {
  bool is_dense;
  Signature signature;
  cv::Mat descriptor;

  template <class Archive>
  void State(Archive& archive) {
    if (is_dense) {
      StateOfDescriptor(archive, descriptor);
    } else {
      archive(signature);
    }
  }
};

/// A filter and the members whose signatures it sees: one each for most rules; all of them, concatenated, for
/// naive (loop-closure.md eq. 3). Or one dense member: then `dense` has what it knows, and its signatures are
/// all empty.
struct FilterUnit : PlaceFilter {
  FilterUnit(std::vector<std::size_t> sources, bool of_dense_member, const LoopDetectorOptions& options)
      : PlaceFilter(options.evidence),
        members(std::move(sources)),
        is_dense(of_dense_member),
        likelihood(options.likelihood) {}
  FilterUnit(FilterUnit&&) = default;
  FilterUnit(const FilterUnit&) = delete;
  std::vector<std::size_t> members;
  bool is_dense;
  LikelihoodModel likelihood;
  DenseModel dense;  ///< of a dense member
  MemberWeight weight;
  Signature signature;         ///< of the present image, empty if bad
  SeenWords seen;              ///< the same, feature by feature; or the descriptor
  double repeated = 0;         ///< its mean count for the few images before
  std::vector<double> scores;  ///< raw ones behind the likelihood, by slot; only with keep_evidence
  bool took_part() const { return !signature.empty() || !seen.descriptor.empty(); }
};

/// Counts (by slot) of every unit for an image; nullptr for one that sits it out.
using UnitCounts = std::vector<const std::vector<double>*>;

/// Steps 3 to 5, 7 and 8 of loop-closure.md section 1. Slots are the same in every memory of one detector.
class MemorySystem {
 public:
  /// `members` are all of the detector's; `units` says which of them each filter of this memory sees.
  /// `number` is the memory's own in the store.
  MemorySystem(int number, const LoopDetectorOptions& options,
               const std::vector<std::vector<std::size_t>>& units, std::vector<Member>& members);

  /// Steps 3 and 4: a new location with these words (one per member of the detector) enters STM, is
  /// rehearsed, and the oldest of STM go to WM. Returns the slot that now stands for the image.
  int Remember(std::int64_t id, const std::vector<SeenWords>& words);

  /// Another recording begins: what was seen last is a candidate like all else, and the filters start afresh.
  void Interrupt();

  /// Factors of the places for the present image (PoseTrack::Gains), empty: none.
  void SetGains(std::vector<double> gains) { gains_ = std::move(gains); }
  /// Step 5. Different units may run at the same time; then the joint filter, if there is one.
  void UpdateLikelihood(std::size_t unit);
  void StepFilter(std::size_t unit);
  void StepJoint();
  /// After the step: the evidence learns from what the filters believe now.
  void Learn();
  /// What the filters believe that took part in this image: the joint one's, or those of the units.
  std::vector<const Belief*> Beliefs() const;

  /// What is believed of an image with these words that is no location: the likelihoods, normalised; of the
  /// joint filter or of each unit that has words of it.
  std::vector<Belief> Opinions(const std::vector<SeenWords>& words) const;
  /// Weight of a unit in the joint filter, over those that took part; their mean is 1.
  double WeightOf(std::size_t unit) const;

  /// The newer location closes a loop with the older one.
  void CloseLoop(int newer, int older);
  /// They do not: takes the loop back.
  void Unlink(int a, int b);
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
  /// A location that is no longer needed is replaced by an older one, if that can be.
  void Replace(int slot, int into);

  /// For a durable store: signatures of a new location; then all nodes that changed since the last time.
  void StoreSignatures(int slot, LocationStore& store) const;
  /// Takes up what a durable store holds: nodes first, then signatures of all in STM and WM, with their
  /// words.
  void Reopen(LocationStore& store);

  template <class Archive>
  void State(Archive& archive);
  /// What the evidence knows of the environment, without single places.
  template <class Archive>
  void StateOfLevels(Archive& archive);

  LocationMemory& memory() { return memory_; }
  const LocationMemory& memory() const { return memory_; }
  std::vector<FilterUnit>& units() { return units_; }
  const std::vector<FilterUnit>& units() const { return units_; }
  /// Null if there is none, or no unit took part in this image.
  const PlaceFilter* joint() const { return joint_ && JointTookPart() ? &*joint_ : nullptr; }
  /// The one filter whose posterior is the ensemble's belief; null: there are several, or it sat this image
  /// out.
  const PlaceFilter* Deciding() const;
  const TransitionModel& transition() const { return transition_; }

 private:
  // One record of a location holds what every unit keeps.
  std::string Record(int slot) const;
  std::vector<UnitRecord> ReadRecord(std::string_view record, const std::string& source) const;
  void CheckUnit(const FilterUnit& unit, const StateReader& in) const;
  void Restore(int slot, LocationStore& store);
  void ReadWord(std::size_t member, int word, LocationStore& store, cv::Mat& descriptors) const;
  // Calls call(member, its part of the signature) for each member of a unit.
  template <typename Call>
  static void ForEachPart(const FilterUnit& unit, const Signature& signature, const Call& call) {
    const std::vector<Signature> parts = signature.Split(static_cast<int>(unit.members.size()));
    for (std::size_t p = 0; p < parts.size(); ++p) call(unit.members[p], parts[p]);
  }
  void Reference(const FilterUnit& unit, const Signature& signature);
  void Release(const FilterUnit& unit, const Signature& signature);
  bool LooksLikePrevious(int slot) const;
  void Forget(int slot);
  void Link(int a, int b, LocationMemory::LinkType type);
  void Relinked(int a, int b);
  bool Counts() const { return options_.evidence.kind == EvidenceKind::kCounts; }
  void Repeat(FilterUnit& unit) const;
  double Overlap(const std::vector<double>& counts) const;
  bool JointTookPart() const;
  UnitCounts PresentCounts() const;
  std::vector<double> Weights(const UnitCounts& counts) const;
  std::vector<double> JointCounts(const UnitCounts& counts, const std::vector<double>& weights) const;
  std::vector<int> NearBest(const PlaceFilter& place_filter) const;

  int number_;
  const LoopDetectorOptions& options_;
  std::vector<Member>& members_;
  std::vector<FilterUnit> units_;
  std::optional<PlaceFilter> joint_;  // works on the units' counts
  MemberOverlap overlap_;             // of the units, for joint_
  std::vector<double> gains_;         // of the places, for the present image
  LocationMemory memory_;
  TransitionModel transition_;
};

}  // namespace tutti::internal
