#include "loopclosure/detector/second_word.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace tutti::internal {
namespace {

using State = LocationMemory::State;

// Below, a loop that was accepted is withdrawn. From here on, one is accepted where loops come in a row.
constexpr double kEvenChance = 0.5;

// Of a verification, what a decision needs: its matches, and the pose that they give, can be found again.
void SaveFigures(const Verification& v, ByteWriter& out) {
  out.Put(v.candidate);
  out.Put<char>(v.similar ? 1 : 0);
  out.Put<char>(v.accepted ? 1 : 0);
  out.Put<std::int32_t>(static_cast<std::int32_t>(v.type));
  out.Put<char>(v.homography ? 1 : 0);
  for (const int count : {v.matches, v.inliers, v.coverage}) out.Put<std::int32_t>(count);
  for (const double figure : {v.expected_inliers, v.log_nfa, v.motion_spread}) out.Put(figure);
}

Verification LoadFigures(ByteReader& in) {
  Verification v;
  v.candidate = in.Get<std::int64_t>();
  v.similar = in.Get<char>() != 0;
  v.accepted = in.Get<char>() != 0;
  v.type = static_cast<ConstraintType>(in.GetIndex(static_cast<int>(ConstraintType::kSimilarity) + 1));
  v.homography = in.Get<char>() != 0;
  for (int* count : {&v.matches, &v.inliers, &v.coverage}) *count = in.Get<std::int32_t>();
  for (double* figure : {&v.expected_inliers, &v.log_nfa, &v.motion_spread}) *figure = in.Get<double>();
  return v;
}

bool Contains(const std::vector<int>& slots, int slot) {
  return std::find(slots.begin(), slots.end(), slot) != slots.end();
}

// Where the loops of the images before and after may lead, if this one leads to `place`.
std::vector<int> Around(std::int64_t place, const LocationMemory& memory) {
  std::vector<int> around;
  for (const auto& [slot, level, loops] :
       memory.Neighbours(memory.Find(place), kAboutHere + Hindsight::kImages))
    around.push_back(slot);
  return around;
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
  if (memory.state(slot) != State::kShortTerm && memory.state(slot) != State::kWorking) return std::nullopt;
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

void SecondWord::Save(ByteWriter& out) const {
  hindsight_.Save(out);
  out.Put<std::int32_t>(static_cast<std::int32_t>(first_.size()));
  for (const First& first : first_) {
    out.Put<std::int32_t>(first.slot);
    out.Put(first.result.query);
    out.Put<char>(first.result.accepted ? 1 : 0);
    SaveFigures(first.result.verification, out);
    out.Put<std::int32_t>(static_cast<std::int32_t>(first.result.tried.size()));
    for (const Verification& tried : first.result.tried) SaveFigures(tried, out);
  }
}

void SecondWord::Load(const LocationMemory& memory, ByteReader& in) {
  const int end = memory.size();
  hindsight_.Load(end, in);
  first_.clear();
  for (int left = in.GetIndex(end + 1); left > 0; --left) {
    First first{in.GetIndex(end), {}};
    first.result.query = in.Get<std::int64_t>();
    first.result.accepted = in.Get<char>() != 0;
    first.result.verification = LoadFigures(in);
    for (int tried = in.GetIndex(end + 1); tried > 0; --tried) first.result.tried.push_back(LoadFigures(in));
    for (const Verification& tried : first.result.tried) {
      if (memory.Find(tried.candidate) < 0) in.Damaged("a loop with an unknown location");
    }
    const std::int64_t chosen = first.result.verification.candidate;
    if (memory.id(first.slot) != first.result.query || (chosen >= 0 && memory.Find(chosen) < 0))
      in.Damaged("a loop of an unknown location");
    first_.push_back(std::move(first));
  }
}

}  // namespace tutti::internal
