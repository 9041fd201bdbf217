#include "loopclosure/detector/second_word.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace tutti::internal {
namespace {

// Below, a loop that was accepted is withdrawn. From here on, one is accepted where loops come in a row.
constexpr double kEvenChance = 0.5;

// What a decision needs of a verification: its matches, and the pose that they give, can be found again.
template <class Archive>
void StateOfFigures(Archive& archive, Verification& v) {
  archive(v.candidate, v.similar, v.accepted, v.type, v.homography, v.matches, v.inliers, v.coverage,
          v.expected_inliers, v.log_nfa, v.motion_spread);
  if constexpr (Archive::kReading) {
    archive.Check(static_cast<int>(v.type), 0, static_cast<int>(ConstraintType::kSimilarity) + 1,
                  "a loop of an unknown kind");
  }
}

bool Contains(const std::vector<int>& slots, int slot) {
  return std::find(slots.begin(), slots.end(), slot) != slots.end();
}

// Where the loops of the images before and after may lead, if this one leads to `place`.
std::vector<int> Around(std::int64_t place, const LocationMemory& memory) {
  return memory.SlotsNear(memory.Find(place), kAboutHere + Hindsight::kImages);
}

// Two of the images before close loops there. One may be an alias, and would drag the next along.
bool InARow(int slot, const std::vector<int>& around, const LocationMemory& memory) {
  constexpr int kFewestLoops = 2;
  int before = 0;
  for (int earlier = std::max(0, slot - Hindsight::kImages); earlier < slot; ++earlier) {
    const std::vector<LocationMemory::Link>& links = memory.links(earlier);
    before += std::any_of(links.begin(), links.end(), [&](const LocationMemory::Link& link) {
      return link.type != LocationMemory::LinkType::kOdometry && link.slot < earlier &&
             Contains(around, link.slot);
    });
  }
  return before >= kFewestLoops;
}

}  // namespace

void SecondWord::Keep(int slot, const LoopResult& result) {
  if (hindsight_.Newest() != slot) return;  // no step, no second word
  First first{slot, {}};
  first.result.query = result.query;
  first.result.accepted = result.accepted;
  first.result.verification = result.verification;
  first.result.tried = result.tried;
  first.result.verification.inlier_matches.clear();
  for (Verification& tried : first.result.tried) tried.inlier_matches.clear();
  first_.push_back(std::move(first));
  if (first_.size() > Hindsight::kImages + 1) first_.pop_front();
}

void SecondWord::Forget() {
  hindsight_.Forget();
  first_.clear();
}

std::optional<LateLoop> SecondWord::Say(const LoopDetectorOptions& options, const LocationMemory& memory,
                                        const TransitionModel& transition, const HypothesisSearch& search) {
  const int slot = hindsight_.Slot();
  while (!first_.empty() && first_.front().slot < slot) first_.pop_front();
  if (slot < 0 || first_.empty() || first_.front().slot != slot) return std::nullopt;
  LoopResult word = std::move(first_.front().result);
  first_.pop_front();
  if (!memory.Holds(slot)) return std::nullopt;
  const Belief belief = hindsight_.Smoothed(transition, memory.working_memory());
  const bool before = word.accepted;
  if (before) {
    search.Reconsider(belief, word);
  } else if (belief.Hypothesis() >= options.propose_threshold) {
    search.VerifyMore(slot, belief, word);
  }
  double needed = options.loop_threshold;
  if (before) {
    needed = std::min(kEvenChance, needed);
  } else if (word.verification.similar) {
    const std::vector<int> around = Around(word.verification.candidate, memory);
    if (!word.verification.accepted && !StillThere(around, memory)) return std::nullopt;
    if (word.verification.accepted && InARow(slot, around, memory)) needed = std::min(kEvenChance, needed);
  }
  const bool now = word.verification.similar && word.probability >= needed;
  if (now == before) return std::nullopt;
  LateLoop late;
  late.query = word.query;
  late.accepted = now;
  late.withdrawn = before;
  late.probability = word.probability;
  late.verification = now ? search.WithMatches(slot, word.verification) : std::move(word.verification);
  return late;
}

// So few inliers that geometry knows no motion show a place from afar, too, when it has been left. It has not
// where one of the images since closes a loop there.
bool SecondWord::StillThere(const std::vector<int>& around, const LocationMemory& memory) const {
  return std::any_of(first_.begin(), first_.end(), [&](const First& since) {
    return since.result.accepted && Contains(around, memory.Find(since.result.verification.candidate));
  });
}

template <class Archive>
void SecondWord::First::State(Archive& archive) {
  archive(slot, result.query, result.accepted);
  StateOfFigures(archive, result.verification);
  std::uint64_t tried = result.tried.size();
  archive(tried);
  for (std::size_t i = 0; i < tried; ++i) {
    if constexpr (Archive::kReading) result.tried.emplace_back();
    StateOfFigures(archive, result.tried[i]);
  }
}

template void SecondWord::First::State(StateWriter& archive);
template void SecondWord::First::State(StateReader& archive);

void SecondWord::Check(const LocationMemory& memory, const StateReader& in) const {
  hindsight_.Check(memory.size(), in);
  for (const First& first : first_) {
    in.Check(first.slot, 0, memory.size(), "a loop of an unknown location");
    const std::int64_t chosen = first.result.verification.candidate;
    if (memory.id(first.slot) != first.result.query || (chosen >= 0 && memory.Find(chosen) < 0))
      in.Damaged("a loop of an unknown location");
    for (const Verification& tried : first.result.tried) {
      if (memory.Find(tried.candidate) < 0) in.Damaged("a loop with an unknown location");
    }
  }
}

}  // namespace tutti::internal
