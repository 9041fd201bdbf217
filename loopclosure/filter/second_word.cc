#include "loopclosure/filter/second_word.h"

#include <algorithm>
#include <utility>

namespace tutti::internal {
namespace {

using State = LocationMemory::State;

constexpr double kWithdrawBelow = 0.5;  // a loop that was accepted, by its probability now

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
  const double needed = before ? std::min(kWithdrawBelow, options.loop_threshold)
                               : Needed(slot, word.verification, options.loop_threshold, memory);
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

// The probability from which on a loop that was not accepted is: more than 1 if none is enough.
double SecondWord::Needed(int slot, const Verification& verification, double loop_threshold,
                          const LocationMemory& memory) const {
  constexpr int kAbout = 4 + Hindsight::kImages;  // graph levels
  constexpr double kInARow = 0.5;
  constexpr int kFewest = 2;  // of the images before: one may be an alias, and drags the next along
  constexpr double kNone = 2;
  if (verification.candidate < 0) return kNone;
  std::vector<int> near;
  for (const auto& [place, level, loops] : memory.Neighbours(memory.Find(verification.candidate), kAbout))
    near.push_back(place);
  const auto there = [&near](int place) { return std::find(near.begin(), near.end(), place) != near.end(); };
  if (!verification.accepted) {
    // So few inliers show the place from afar, too, when it has been left: one of the images since must close
    // a loop there.
    const bool still = std::any_of(first_.begin(), first_.end(), [&](const First& since) {
      return since.result.accepted && there(memory.Find(since.result.verification.candidate));
    });
    return still ? loop_threshold : kNone;
  }
  int before = 0;  // images that close loops there
  for (int earlier = std::max(0, slot - Hindsight::kImages); earlier < slot; ++earlier) {
    const std::vector<LocationMemory::Link>& links = memory.links(earlier);
    before += std::any_of(links.begin(), links.end(), [&](const LocationMemory::Link& link) {
      return link.type != LocationMemory::LinkType::kOdometry && link.slot < earlier && there(link.slot);
    });
  }
  return before >= kFewest ? std::min(kInARow, loop_threshold) : loop_threshold;
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
