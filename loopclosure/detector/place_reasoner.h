// Which place an image shows, by the words of the members: memories, filters, and the rule that makes one
// belief of them.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/numbers.h"
#include "loopclosure/detector/hypothesis_search.h"
#include "loopclosure/detector/second_word.h"
#include "loopclosure/filter/combination.h"
#include "loopclosure/filter/memory_system.h"
#include "loopclosure/filter/pose_track.h"
#include "loopclosure/memory/member.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// Steps 3 to 5 of loop-closure.md section 1, and the links that later steps make. Knows nothing of images.
class PlaceReasoner {
 public:
  /// `options` and `members` must outlive this object and stay where they are.
  PlaceReasoner(const LoopDetectorOptions& options, std::vector<Member>& members);

  /// Steps 3 and 4: the words of each member enter memory as a new location. Returns the slot that now stands
  /// for the image: the newest, or an older one that it was merged into. `prior`: where it was taken.
  int Remember(std::int64_t id, const std::vector<SeenWords>& words,
               const std::optional<PosePrior>& prior = {});
  /// Another recording begins (MemorySystem::Interrupt).
  void Interrupt();
  /// Step 5, and the times of its parts into `result`. `disturb`, if given, may change what each filter unit
  /// has counted: for tests of what a broken member does.
  CombinedBelief Step(LoopResult& result, const std::function<void(std::size_t, FilterUnit&)>& disturb = {});
  /// What is believed of an image with these words that is no location, without the images before it.
  CombinedBelief Locate(const std::vector<SeenWords>& words) const;

  /// Fills hypothesis, best, candidate and posterior of `result`, and what each member believes; features and
  /// words of the members are left to the caller.
  void Explain(const CombinedBelief& combined, LoopResult& result) const;
  /// True if the belief is strong enough for geometry to look at it; else `result` says why not.
  bool Proposes(const CombinedBelief& combined, LoopResult& result);
  /// Step 6: geometry looks at the most probable places; fills verification, tried, accepted, probability and
  /// reason of `result`. Without verification the candidate is taken by its posterior alone.
  void Verify(const View& query, const Belief& belief, const HypothesisSearch& search,
              LoopResult& result) const;
  /// Step 7: what is decided now of the image Hindsight::kImages before this one, into result.late; nothing
  /// if it stays as it was.
  void VerifyAgain(const HypothesisSearch& search, LoopResult& result);
  /// Links the places of a loop that is nearly certain.
  void Finish(const LoopResult& result);

  /// The newer location closes a loop with the older one: their places are one, for the filter.
  void CloseLoop(std::int64_t newer, std::int64_t older);
  /// They do not.
  void Unlink(std::int64_t a, std::int64_t b);
  void AddLink(std::int64_t a, std::int64_t b);
  /// A location is replaced by an older one, in every memory or in none: false, if one of them can't.
  bool Replace(int slot, std::int64_t into);

  /// All locations: those of the shared memory, or what is in any member's.
  const LocationMemory& memory() const { return Shared() ? systems_.front()->memory() : union_; }
  bool Shared() const { return systems_.size() == 1; }
  const std::vector<std::unique_ptr<MemorySystem>>& systems() const { return systems_; }
  LocationMemory& union_of_all() { return union_; }
  /// True if some memory has the slot in STM or WM.
  bool InMemory(int slot) const;
  /// What must be the same for stored locations to be of use.
  std::string Fingerprint() const;

  /// Where the locations were taken.
  PoseTrack& track() { return track_; }

  /// What is kept for second words.
  SecondWord& second_word() { return second_word_; }

  /// Running figures: all but memories, filters, track and second words.
  template <class Archive>
  void State(Archive& archive) {
    archive(last_hypothesis_);
    if constexpr (Archive::kReading) {
      if (!(last_hypothesis_ >= 0.0 && last_hypothesis_ <= 1.0 + 1e-6))
        archive.Damaged("the detector's statistics");
    }
    for (const auto& system : systems_) system->StateOfLevels(archive);
  }

 private:
  void ForEachUnit(const std::function<void(MemorySystem&, std::size_t)>& call);
  CandidateEvidence EvidenceAt(int slot, const std::vector<double>& scores, const PlaceFilter& filter) const;
  void FillOpinion(std::size_t member, const CombinedBelief& combined, MemberOpinion& opinion) const;
  void NoteStep();

  const LoopDetectorOptions& options_;
  std::vector<Member>& members_;
  std::vector<std::unique_ptr<MemorySystem>> systems_;  // one, or one per filter
  LocationMemory union_;                                // per-member memories: what is in any of them
  PoseTrack track_;
  SecondWord second_word_;
  double last_hypothesis_ = 0.0;
};

}  // namespace tutti::internal
