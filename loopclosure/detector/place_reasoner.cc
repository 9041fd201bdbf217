#include "loopclosure/detector/place_reasoner.h"

#include <algorithm>
#include <cstdio>

#include "core/parallel.h"
#include "core/stopwatch.h"
#include "loopclosure/detector/hypothesis_search.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

std::vector<std::vector<std::size_t>> UnitsOf(const LoopDetectorOptions& options) {
  std::vector<std::vector<std::size_t>> units;
  for (std::size_t k = 0; k < options.members.size(); ++k) {
    if (options.rule == CombinationRule::kNaive && k > 0) {
      units.front().push_back(k);
    } else {
      units.push_back({k});
    }
  }
  return units;
}

}  // namespace

PlaceReasoner::PlaceReasoner(const LoopDetectorOptions& options, std::vector<Member>& members)
    : options_(options), members_(members), union_(options.stm_size) {
  const std::vector<std::vector<std::size_t>> units = UnitsOf(options);
  if (options.memory == MemoryKind::kShared) {
    systems_.push_back(std::make_unique<MemorySystem>(0, options_, units, members_));
    return;
  }
  for (const std::vector<std::size_t>& unit : units) {
    const int number = static_cast<int>(systems_.size());
    systems_.push_back(std::make_unique<MemorySystem>(number, options_,
                                                      std::vector<std::vector<std::size_t>>{unit}, members_));
  }
}

int PlaceReasoner::Remember(std::int64_t id, const std::vector<SeenWords>& words,
                            const std::optional<PosePrior>& prior) {
  const int newest = memory().size();
  track_.Add(newest, prior);
  if (!Shared()) union_.Add(id);
  bool dropped_by_all = true;
  int stands_for = newest;
  for (auto& system : systems_) {
    const int slot = system->Remember(id, words);
    if (slot == newest) dropped_by_all = false;
    stands_for = slot;
  }
  if (!Shared()) {
    stands_for = dropped_by_all ? union_.DropNewest() : newest;
    union_.Settle();
  }
  return stands_for;
}

void PlaceReasoner::Interrupt() {
  for (auto& system : systems_) system->Interrupt();
  if (!Shared()) union_.Settle(0);
  track_.Interrupt();
  second_word_.Forget();
  last_hypothesis_ = 0;
}

void PlaceReasoner::ForEachUnit(const std::function<void(MemorySystem&, std::size_t)>& call) {
  std::vector<std::pair<MemorySystem*, std::size_t>> units;
  for (auto& system : systems_) {
    for (std::size_t u = 0; u < system->units().size(); ++u) units.emplace_back(system.get(), u);
  }
  RunParallel(static_cast<int>(units.size()), options_.threads,
              [&](int i) { call(*units[Index(i)].first, units[Index(i)].second); });
}

CombinedBelief PlaceReasoner::Step(LoopResult& result,
                                   const std::function<void(std::size_t, FilterUnit&)>& disturb) {
  Stopwatch watch;
  for (auto& system : systems_) system->SetGains(track_.Gains(system->memory().working_memory()));
  ForEachUnit([&](MemorySystem& system, std::size_t u) {
    system.UpdateLikelihood(u);
    if (disturb) disturb(u, system.units()[u]);
  });
  result.likelihood_ms = watch.LapMs();
  ForEachUnit([](MemorySystem& system, std::size_t u) { system.StepFilter(u); });
  std::vector<const Belief*> beliefs;
  for (auto& system : systems_) {
    system->StepJoint();
    for (const Belief* belief : system->Beliefs()) beliefs.push_back(belief);
  }
  CombinedBelief combined = Combine(options_.rule, beliefs, options_.propose_threshold, memory());
  Explain(combined, result);
  for (auto& system : systems_) system->Learn();
  NoteStep();
  result.filter_ms = watch.LapMs();
  return combined;
}

void PlaceReasoner::NoteStep() {
  const int newest = memory().size() - 1;
  // Published methods, whose evidence is another one, know no second word.
  const bool second_word = Shared() && options_.evidence.kind == EvidenceKind::kCounts;
  const PlaceFilter* filter = second_word ? systems_.front()->Deciding() : nullptr;
  if (filter == nullptr || memory().state(newest) != LocationState::kShortTerm ||
      memory().working_memory().empty())
    return;
  second_word_.Step(newest, filter->filter.posterior(), filter->image_likelihood);
}

CombinedBelief PlaceReasoner::Locate(const std::vector<SeenWords>& words) const {
  std::vector<Belief> opinions;
  for (const auto& system : systems_) {
    for (Belief& opinion : system->Opinions(words)) opinions.push_back(std::move(opinion));
  }
  std::vector<const Belief*> beliefs;
  beliefs.reserve(opinions.size());
  for (const Belief& opinion : opinions) beliefs.push_back(&opinion);
  return Combine(options_.rule, beliefs, 0, memory());
}

void PlaceReasoner::Explain(const CombinedBelief& combined, LoopResult& result) const {
  result.hypothesis = combined.hypothesis;
  if (combined.best >= 0) {
    result.candidate = result.best = memory().id(combined.best);
    result.posterior = PosteriorAt(combined.belief, combined.best);
  }
  result.members.resize(members_.size());
  for (std::size_t k = 0; k < members_.size(); ++k) {
    result.members[k].name = members_[k].name();
    FillOpinion(k, combined, result.members[k]);
  }
  if (!options_.keep_posterior && !options_.keep_evidence) return;
  for (const int slot : memory().working_memory()) {
    result.posterior_by_location.emplace_back(memory().id(slot), PosteriorAt(combined.belief, slot));
  }
  const PlaceFilter* joint = options_.keep_evidence && Shared() ? systems_.front()->joint() : nullptr;
  if (joint == nullptr) return;
  for (const int slot : memory().working_memory()) {
    result.evidence.push_back(EvidenceAt(slot, joint->counts, *joint));
  }
}

CandidateEvidence PlaceReasoner::EvidenceAt(int slot, const std::vector<double>& scores,
                                            const PlaceFilter& filter) const {
  return {memory().id(slot), Index(slot) < scores.size() ? scores[Index(slot)] : 0.0,
          PosteriorAt(filter.image_likelihood, slot), PosteriorAt(filter.filter.posterior(), slot)};
}

void PlaceReasoner::FillOpinion(std::size_t member, const CombinedBelief& combined,
                                MemberOpinion& opinion) const {
  const std::size_t number = options_.rule == CombinationRule::kNaive ? 0 : member;  // of UnitsOf
  const MemorySystem& system = *systems_[Shared() ? 0 : number];
  const std::size_t of_system = Shared() ? number : 0;
  const FilterUnit& unit = system.units()[of_system];
  opinion.took_part = unit.took_part();
  if (!unit.took_part()) return;
  const Belief& posterior = unit.filter.posterior();
  opinion.hypothesis = posterior.Hypothesis();
  opinion.weight = options_.rule == CombinationRule::kJoint ? system.WeightOf(of_system) : 1.0;
  const int best = posterior.Best();
  if (best >= 0) opinion.best = memory().id(best);
  if (combined.best >= 0) opinion.at_candidate = PosteriorAt(posterior, combined.best);
  for (const int slot : memory().working_memory()) {
    if (options_.keep_posterior) {
      opinion.posterior_by_location.emplace_back(memory().id(slot), PosteriorAt(posterior, slot));
    }
    if (options_.keep_evidence) opinion.evidence.push_back(EvidenceAt(slot, unit.scores, unit));
  }
}

bool PlaceReasoner::Proposes(const CombinedBelief& combined, LoopResult& result) {
  if (memory().working_memory().empty()) {
    result.reason = "no location is old enough to be a candidate yet";
    return false;
  }
  if (combined.best < 0) {
    result.reason = "no member has enough features in this image";
    return false;
  }
  const double threshold = std::max(options_.propose_threshold, options_.hypothesis_ratio * last_hypothesis_);
  if (!(result.hypothesis >= threshold)) {
    char text[128];
    std::snprintf(text, sizeof text, "the hypothesis is too weak (%.3f, %.3f is needed to verify it)",
                  result.hypothesis, threshold);
    result.reason = text;
    return false;
  }
  return true;
}

void PlaceReasoner::Verify(const View& query, const Belief& belief, const HypothesisSearch& search,
                           LoopResult& result) const {
  if (!options_.verification.enabled) {
    result.verification.candidate = result.best;
    result.verification.similar = result.verification.accepted = true;
    result.probability = MassAround(belief, memory().Find(result.best), memory());
  } else {
    search.Verify(query, belief, result);
    if (result.verification.candidate >= 0) result.candidate = result.verification.candidate;
    if (!result.verification.similar) return;
  }
  // Where geometry knows no motion, the place may have been left, and be seen from afar: the belief, which
  // lags behind, would make a loop of it. The next images know better (SecondWord).
  const bool probable = result.probability >= options_.loop_threshold;
  result.accepted = probable && result.verification.accepted;
  if (result.accepted) return;
  if (probable) {
    result.reason = result.verification.reason;
    return;
  }
  char text[128];
  std::snprintf(text, sizeof text, "probably not this place (probability %.3f, %.3f is needed)",
                result.probability, options_.loop_threshold);
  result.reason = text;
}

void PlaceReasoner::VerifyAgain(const HypothesisSearch& search, LoopResult& result) {
  if (!options_.verification.enabled || !Shared()) return;
  result.late = second_word_.Say(options_, memory(), systems_.front()->transition(), search);
}

void PlaceReasoner::Finish(const LoopResult& result) {
  last_hypothesis_ = result.hypothesis;
  if (result.accepted && result.probability >= options_.link_threshold) {
    CloseLoop(result.query, result.verification.candidate);
  }
  if (result.late && result.late->withdrawn) Unlink(result.late->query, result.late->verification.candidate);
  if (result.late && result.late->accepted && result.late->probability >= options_.link_threshold) {
    CloseLoop(result.late->query, result.late->verification.candidate);
  }
  const int newest = memory().size() - 1;
  if (newest >= 0 && memory().id(newest) == result.query) second_word_.Keep(newest, result);
}

void PlaceReasoner::CloseLoop(std::int64_t newer, std::int64_t older) {
  if (!Shared()) union_.AddLink(union_.Find(newer), union_.Find(older), LocationMemory::LinkType::kLoop);
  for (auto& system : systems_) {
    system->CloseLoop(system->memory().Find(newer), system->memory().Find(older));
  }
}

void PlaceReasoner::Unlink(std::int64_t a, std::int64_t b) {
  if (memory().Find(a) < 0 || memory().Find(b) < 0) return;
  if (!Shared()) union_.RemoveLoop(union_.Find(a), union_.Find(b));
  for (auto& system : systems_) system->Unlink(system->memory().Find(a), system->memory().Find(b));
}

void PlaceReasoner::AddLink(std::int64_t a, std::int64_t b) {
  for (const std::int64_t id : {a, b}) {
    if (memory().Find(id) < 0) {
      throw InputError("AddLink: there is no location with id " + std::to_string(id));
    }
  }
  if (!Shared()) union_.AddLink(union_.Find(a), union_.Find(b), LocationMemory::LinkType::kOdometry);
  for (auto& system : systems_) system->AddLink(system->memory().Find(a), system->memory().Find(b));
}

bool PlaceReasoner::Replace(int slot, std::int64_t into) {
  const auto can = [&](const LocationMemory& m) { return m.CanMerge(slot, m.Find(into)); };
  const bool all = std::all_of(systems_.begin(), systems_.end(),
                               [&](const auto& system) { return can(system->memory()); });
  if (!all || (!Shared() && !can(union_))) return false;
  for (auto& system : systems_) system->Replace(slot, system->memory().Find(into));
  if (!Shared()) union_.Merge(slot, union_.Find(into));
  return true;
}

bool PlaceReasoner::InMemory(int slot) const {
  return std::any_of(systems_.begin(), systems_.end(),
                     [slot](const auto& system) { return system->memory().Holds(slot); });
}

std::string PlaceReasoner::Fingerprint() const {
  std::string text = "members";
  for (const Member& member : members_) {
    const std::string details = member.Fingerprint();
    text += " " + member.name() + (details.empty() ? "" : " (" + details + ")");
  }
  text += options_.rule == CombinationRule::kNaive   ? ", one naive filter"
          : options_.rule == CombinationRule::kJoint ? ", a joint filter"
                                                     : ", a filter each";
  text += options_.evidence.kind == EvidenceKind::kCounts ? ", counts" : ", standardised";
  text += Shared() ? ", shared memory" : ", a memory per member";
  return text;
}

}  // namespace tutti::internal
