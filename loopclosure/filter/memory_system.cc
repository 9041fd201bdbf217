#include "loopclosure/filter/memory_system.h"

#include <algorithm>
#include <utility>

#include "core/numbers.h"
#include "loopclosure/filter/pose_track.h"

namespace tutti::internal {
namespace {

constexpr int kNearLevels = 5;  // what is so near to the most probable place may be it
constexpr int kRepeats = 3;     // images before this one that show what a member repeats

// Words of all members that a filter sees, with ids as Signature::Split takes them apart.
SeenWords WordsFor(const FilterUnit& unit, const std::vector<SeenWords>& words) {
  const int parts = static_cast<int>(unit.members.size());
  SeenWords all;
  for (int p = 0; p < parts; ++p) {
    const SeenWords& part = words[unit.members[Index(p)]];
    for (const int word : part.words) all.words.push_back(word < 0 ? word : word * parts + p);
    all.cells.insert(all.cells.end(), part.cells.begin(), part.cells.end());
    if (unit.is_dense) all.descriptor = part.descriptor;
  }
  return all;
}

}  // namespace

MemorySystem::MemorySystem(int number, const LoopDetectorOptions& options,
                           const std::vector<std::vector<std::size_t>>& units, std::vector<Member>& members)
    : number_(number), options_(options), members_(members), memory_(options.stm_size) {
  for (const std::vector<std::size_t>& sources : units) {
    units_.emplace_back(sources, sources.size() == 1 && members_[sources.front()].dense(), options);
    if (units_.back().is_dense) units_.back().dense = DenseModel(members_[sources.front()].width());
  }
  if (options.rule == CombinationRule::kJoint) joint_.emplace(options.evidence);
}

int MemorySystem::Remember(std::int64_t id, const std::vector<SeenWords>& words) {
  int slot = memory_.Add(id);
  bool any_took_part = false;
  for (FilterUnit& unit : units_) {
    unit.seen = WordsFor(unit, words);
    unit.signature = Signature(unit.seen.words);
    any_took_part = any_took_part || unit.took_part();
    unit.likelihood.Add(unit.signature);
    if (unit.is_dense) unit.dense.Add(unit.seen.descriptor);
    Reference(unit, unit.signature);
  }
  int stands_for = -1;
  if (!any_took_part && options_.ignore_bad_signatures) {
    stands_for = memory_.IgnoreNewest();
  } else if (options_.rehearsal && LooksLikePrevious(slot)) {
    stands_for = memory_.DropNewest();
  }
  if (stands_for >= 0) {
    for (FilterUnit& unit : units_) {
      unit.likelihood.Remove(slot);
      if (unit.is_dense) unit.dense.Drop(slot);
      Release(unit, unit.signature);
    }
    slot = stands_for;
  }
  transition_.Update(memory_, memory_.Settle());
  return slot;
}

void MemorySystem::Interrupt() {
  transition_.Update(memory_, memory_.Settle(0));
  for (FilterUnit& unit : units_) {
    unit.filter = BayesFilter();
    unit.repeated = 0;  // of images that the next one does not follow
  }
  if (joint_) joint_->filter = BayesFilter();
}

bool MemorySystem::LooksLikePrevious(int slot) const {
  const std::deque<int>& recent = memory_.short_term_memory();
  if (recent.size() < 2) return false;
  const int previous = recent[recent.size() - 2];
  double sum = 0.0;
  int units = 0;
  for (const FilterUnit& unit : units_) {
    if (unit.is_dense) continue;
    sum += Signature::Similarity(unit.likelihood.signature(slot), unit.likelihood.signature(previous));
    ++units;
  }
  if (units > 0) return sum / units >= options_.rehearsal_similarity;
  // Dense members alone: they must be as good as equal, for all images have much in common for them.
  constexpr double kEqual = 0.98;
  return std::all_of(units_.begin(), units_.end(), [&](const FilterUnit& unit) {
    const cv::Mat& now = unit.dense.descriptor(slot);
    const cv::Mat& before = unit.dense.descriptor(previous);
    return !now.empty() && !before.empty() && now.dot(before) >= kEqual;
  });
}

// What the unit shares with the few images before, which show nearly the same.
void MemorySystem::Repeat(FilterUnit& unit) const {
  const std::deque<int>& recent = memory_.short_term_memory();
  double sum = 0;
  int images = 0;
  for (auto slot = recent.rbegin(); slot != recent.rend() && images <= kRepeats; ++slot, ++images) {
    if (slot != recent.rbegin()) sum += unit.counts[Index(*slot)];
  }
  if (images < 2) return;
  unit.repeated = sum / (images - 1) * (unit.is_dense ? DenseModel::kRepeatShare : 1.0);
  unit.weight.Repeat(unit.repeated);
}

// Share of what the image counts for itself that the one before has, too.
double MemorySystem::Overlap(const std::vector<double>& counts) const {
  const std::deque<int>& recent = memory_.short_term_memory();
  if (recent.size() < 2) return 0.0;
  const double own = counts[Index(recent.back())];
  const double before = counts[Index(recent[recent.size() - 2])];
  return std::min(1.0, before / std::max(1.0, own));
}

void MemorySystem::UpdateLikelihood(std::size_t u) {
  FilterUnit& unit = units_[u];
  if (!unit.took_part()) return;
  const std::vector<int>& places = memory_.working_memory();
  if (Counts()) {
    const Sight sight{memory_.short_term_memory().front()};
    unit.counts = unit.is_dense ? unit.dense.Counts(places) : unit.likelihood.Counts(unit.seen, sight);
    Repeat(unit);
    if (places.empty()) return;
    unit.image_likelihood =
        unit.alias.Likelihood(unit.counts, places, unit.seen.Amount(), unit.repeated, Overlap(unit.counts));
    ApplyGains(gains_, places, unit.image_likelihood);
    if (options_.keep_evidence) unit.scores = unit.counts;
    return;
  }
  std::vector<double> scores = unit.is_dense ? unit.dense.Scores() : unit.likelihood.Scores(unit.signature);
  unit.image_likelihood = AdjustLikelihood(scores, places);
  ApplyGains(gains_, places, unit.image_likelihood);
  if (options_.keep_evidence) unit.scores = std::move(scores);
}

void MemorySystem::StepFilter(std::size_t u) {
  FilterUnit& unit = units_[u];
  if (!unit.took_part()) return;
  if (Counts() && memory_.working_memory().empty()) return;
  unit.filter.Step(transition_, memory_.working_memory(), unit.image_likelihood);
}

bool MemorySystem::JointTookPart() const {
  return std::any_of(units_.begin(), units_.end(), [](const FilterUnit& unit) { return unit.took_part(); });
}

UnitCounts MemorySystem::PresentCounts() const {
  UnitCounts counts;
  counts.reserve(units_.size());
  for (const FilterUnit& unit : units_) counts.push_back(unit.took_part() ? &unit.counts : nullptr);
  return counts;
}

// Scaled so that their sum is the number of units that say something of their own: a unit that sits out
// leaves its share to the others.
std::vector<double> MemorySystem::Weights(const UnitCounts& counts) const {
  std::vector<double> weights(units_.size(), 0.0);
  double sum = 0;
  double all = 0;
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const double copies = overlap_.Copies(u);  // what others say, too, is said once
    all += 1.0 / copies;
    if (counts[u] == nullptr) continue;
    weights[u] = units_[u].weight.Value() / copies;
    sum += weights[u];
  }
  const double scale = sum > 0 ? all / sum : 0.0;
  for (double& weight : weights) weight *= scale;
  return weights;
}

double MemorySystem::WeightOf(std::size_t unit) const { return Weights(PresentCounts())[unit]; }

std::vector<double> MemorySystem::JointCounts(const UnitCounts& counts,
                                              const std::vector<double>& weights) const {
  std::vector<double> sum(Index(memory_.size()), 0.0);
  for (std::size_t u = 0; u < units_.size(); ++u) {
    if (counts[u] == nullptr) continue;
    const std::vector<double>& own = *counts[u];
    const double weight = weights[u];
    for (std::size_t i = 0; i < own.size(); ++i) sum[i] += weight * own[i];
  }
  return sum;
}

void MemorySystem::StepJoint() {
  if (!joint_ || !JointTookPart() || memory_.working_memory().empty()) return;
  const UnitCounts counts = PresentCounts();
  const std::vector<double> weights = Weights(counts);
  joint_->counts = JointCounts(counts, weights);
  double words = 0;
  double repeated = 0;
  for (std::size_t u = 0; u < units_.size(); ++u) {
    words += units_[u].took_part() ? units_[u].seen.Amount() : 0;
    repeated += weights[u] * units_[u].repeated;
  }
  joint_->image_likelihood = joint_->alias.Likelihood(joint_->counts, memory_.working_memory(), words,
                                                      repeated, Overlap(joint_->counts));
  ApplyGains(gains_, memory_.working_memory(), joint_->image_likelihood);
  joint_->filter.Step(transition_, memory_.working_memory(), joint_->image_likelihood);
}

std::vector<int> MemorySystem::NearBest(const PlaceFilter& place_filter) const {
  const int best = place_filter.filter.posterior().Best();
  return best < 0 ? std::vector<int>() : memory_.SlotsNear(best, kNearLevels);
}

void MemorySystem::Learn() {
  if (!Counts() || memory_.working_memory().empty() || !JointTookPart()) return;
  const std::vector<int>& places = memory_.working_memory();
  for (FilterUnit& unit : units_) {
    if (!unit.took_part()) continue;
    unit.alias.Learn(unit.counts, places, NearBest(unit), unit.filter.posterior().new_place);
  }
  if (!joint_) return;
  const std::vector<int> near = NearBest(*joint_);
  joint_->alias.Learn(joint_->counts, places, near, joint_->filter.posterior().new_place);
  for (FilterUnit& unit : units_) {
    if (unit.took_part()) unit.weight.Learn(unit.counts, places, near);
  }
  overlap_.Learn(PresentCounts(), places, near);
}

const PlaceFilter* MemorySystem::Deciding() const {
  if (joint_) return joint();
  return units_.size() == 1 && units_.front().took_part() ? &units_.front() : nullptr;
}

std::vector<const Belief*> MemorySystem::Beliefs() const {
  std::vector<const Belief*> beliefs;
  if (joint_) {
    if (JointTookPart()) beliefs.push_back(&joint_->filter.posterior());
    return beliefs;
  }
  for (const FilterUnit& unit : units_) {
    if (unit.took_part()) beliefs.push_back(&unit.filter.posterior());
  }
  return beliefs;
}

std::vector<Belief> MemorySystem::Opinions(const std::vector<SeenWords>& words) const {
  const std::vector<int>& places = memory_.working_memory();
  std::vector<Belief> opinions;
  std::vector<std::vector<double>> counts(units_.size());
  UnitCounts taking_part(units_.size(), nullptr);
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const FilterUnit& unit = units_[u];
    const SeenWords seen = WordsFor(unit, words);
    if (seen.Amount() == 0) continue;
    if (!Counts()) {
      opinions.push_back(AdjustLikelihood(unit.is_dense ? unit.dense.ScoresOf(seen.descriptor)
                                                        : unit.likelihood.Scores(Signature(seen.words)),
                                          places));
      continue;
    }
    counts[u] = unit.is_dense ? unit.dense.CountsOf(seen.descriptor, places) : unit.likelihood.Counts(seen);
    taking_part[u] = &counts[u];
    if (!joint_) opinions.push_back(unit.alias.Of(counts[u], places));
  }
  const bool any =
      std::any_of(taking_part.begin(), taking_part.end(), [](auto unit) { return unit != nullptr; });
  if (joint_ && any) {
    opinions.push_back(joint_->alias.Of(JointCounts(taking_part, Weights(taking_part)), places));
  }
  for (Belief& opinion : opinions) opinion.Normalise();
  return opinions;
}

void MemorySystem::CloseLoop(int newer, int older) {
  if (older < 0 || newer == older) return;
  Link(newer, older, LocationMemory::LinkType::kLoop);
  memory_.TransferWeight(newer, older);
}

void MemorySystem::Unlink(int a, int b) {
  if (a >= 0 && b >= 0 && memory_.RemoveLoop(a, b)) Relinked(a, b);
}

void MemorySystem::AddLink(int a, int b) { Link(a, b, LocationMemory::LinkType::kOdometry); }

void MemorySystem::Link(int a, int b, LocationMemory::LinkType type) {
  if (memory_.AddLink(a, b, type)) Relinked(a, b);
}

void MemorySystem::Relinked(int a, int b) {
  // A link to a location outside WM takes effect when that one enters it.
  const auto in_wm = [this](int slot) { return memory_.state(slot) == LocationState::kWorking; };
  if (in_wm(a) && in_wm(b)) transition_.Update(memory_, {a, b});
}

void MemorySystem::Reference(const FilterUnit& unit, const Signature& signature) {
  ForEachPart(unit, signature, [this](std::size_t member, const Signature& part) {
    members_[member].vocabulary().AddReferences(part);
  });
}

void MemorySystem::Release(const FilterUnit& unit, const Signature& signature) {
  ForEachPart(unit, signature, [this](std::size_t member, const Signature& part) {
    members_[member].vocabulary().RemoveReferences(part);
  });
}

}  // namespace tutti::internal
