#include "tutti/loopclosure/detector.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "detector_impl.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/parallel.h"

namespace tutti {

using internal::FilterUnit;
using internal::MemorySystem;
using internal::PosteriorAt;

namespace {

class Stopwatch {
 public:
  double LapMs() {
    const auto now = Clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - lap_).count();
    lap_ = now;
    return ms;
  }
  double TotalMs() const { return std::chrono::duration<double, std::milli>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
  Clock::time_point lap_ = start_;
};

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

LoopDetector::Impl::Impl(const LoopDetectorOptions& options, std::unique_ptr<internal::LocationStore> store)
    : options_(options),
      union_(options.stm_size),
      verifier_(options.verification, options.seed),
      store_(std::move(store)) {
  const std::string problem = options.Validate();
  if (!problem.empty()) throw InputError("loop-closure options: " + problem);
  members_.reserve(options.members.size());
  for (std::size_t k = 0; k < options.members.size(); ++k) {
    members_.emplace_back(options.members[k], options_, options.seed * 1000003u + k);
  }
  const std::vector<std::vector<std::size_t>> units = UnitsOf(options);
  if (options.memory == MemoryKind::kShared) {
    systems_.push_back(std::make_unique<MemorySystem>(0, options_, units, members_));
  } else {
    for (const std::vector<std::size_t>& unit : units) {
      const int number = static_cast<int>(systems_.size());
      systems_.push_back(std::make_unique<MemorySystem>(
          number, options_, std::vector<std::vector<std::size_t>>{unit}, members_));
    }
  }
  unstored_nodes_.resize(systems_.size() + 1);
  stored_words_.resize(members_.size(), 0);
  if (!store_ && !options.ltm_file.empty()) {
    store_ = std::make_unique<internal::LocationStore>(options.ltm_file);
    Reopen();
  }
}

LoopResult LoopDetector::Impl::Detect(const LoopQuery& query) {
  CheckQuery(query);
  LoopResult result;
  result.query = query.id;
  Stopwatch watch;

  const std::vector<Features> features = Extract(query);
  result.extract_ms = watch.LapMs();

  const std::vector<Signature> signatures = Quantise(features);
  result.quantise_ms = watch.LapMs();

  const int slot = Remember(query, features, signatures);
  result.memory_ms = watch.LapMs();

  ForEachUnit([](MemorySystem& system, std::size_t u) { system.UpdateLikelihood(u); });
  result.likelihood_ms = watch.LapMs();

  ForEachUnit([](MemorySystem& system, std::size_t u) { system.StepFilter(u); });
  const CombinedBelief combined = CombineUnits();
  FillOpinions(features, combined, result);
  result.filter_ms = watch.LapMs();

  Decide(slot, combined, result);
  result.probability = result.hypothesis;
  result.verify_ms = watch.LapMs();

  if (result.accepted) CloseLoop(query.id, result.verification.candidate);
  last_hypothesis_ = result.hypothesis;
  const int hypothesis = result.hypothesis > 0.0 ? combined.best : -1;  // 0: the members do not agree on one
  Retrieve(hypothesis, result);
  Shrink(hypothesis, watch.TotalMs(), result);
  Journal(static_cast<int>(views_.size()) - 1, result);
  result.memory_ms += watch.LapMs();
  return result;
}

void LoopDetector::Impl::AddLink(std::int64_t a, std::int64_t b) {
  for (const std::int64_t id : {a, b}) {
    if (memory().Find(id) < 0) {
      throw InputError("AddLink: there is no location with id " + std::to_string(id));
    }
  }
  if (!Shared()) union_.AddLink(union_.Find(a), union_.Find(b), LocationMemory::LinkType::kOdometry);
  for (auto& system : systems_) system->AddLink(system->memory().Find(a), system->memory().Find(b));
}

std::vector<Features> LoopDetector::Impl::Extract(const LoopQuery& query) const {
  std::vector<Features> features(members_.size());
  const bool all_given = std::all_of(members_.begin(), members_.end(), [&](const Member& m) {
    return query.member_features.count(m.name()) > 0;
  });
  const cv::Mat grey = all_given ? cv::Mat() : ToGrey8(query.image);
  RunParallel(static_cast<int>(members_.size()), options_.threads, [&](int k) {
    const auto given = query.member_features.find(members_[Index(k)].name());
    if (given == query.member_features.end()) {
      features[Index(k)] = members_[Index(k)].Extract(grey);
    } else {
      // The caller owns the matrix and may write into it later: keep a copy.
      features[Index(k)] = {given->second.keypoints, given->second.descriptors.clone()};
    }
    DropMasked(query.mask, features[Index(k)]);
  });
  return features;
}

// The searches of all members are shared out among the threads in pieces; what they find does not depend on
// who searched.
std::vector<std::vector<TwoNearest>> LoopDetector::Impl::SearchWords(const std::vector<Features>& features,
                                                                     const std::vector<char>& usable) const {
  constexpr int kBlock = 25;
  struct Piece {
    std::size_t member;
    int begin;
  };
  std::vector<Piece> pieces;
  std::vector<std::vector<TwoNearest>> nearest(members_.size());
  for (std::size_t k = 0; k < members_.size(); ++k) {
    if (usable[k] == 0) continue;
    nearest[k].resize(Index(features[k].descriptors.rows));
    for (int i = 0; i < features[k].descriptors.rows; i += kBlock) pieces.push_back({k, i});
  }
  RunParallel(static_cast<int>(pieces.size()), options_.threads, [&](int p) {
    const auto& [k, begin] = pieces[Index(p)];
    const cv::Mat& rows = features[k].descriptors;
    members_[k].vocabulary().Search(rows, begin, std::min(rows.rows, begin + kBlock), nearest[k]);
  });
  return nearest;
}

// Step 2 of section 1.
std::vector<Signature> LoopDetector::Impl::Quantise(const std::vector<Features>& features) {
  std::vector<char> usable(members_.size());
  for (std::size_t k = 0; k < members_.size(); ++k) usable[k] = members_[k].Judge(features[k]) ? 1 : 0;
  const std::vector<std::vector<TwoNearest>> nearest = SearchWords(features, usable);
  std::vector<Signature> signatures(members_.size());
  RunParallel(static_cast<int>(members_.size()), options_.threads, [&](int i) {
    const std::size_t k = Index(i);
    if (usable[k] == 0) return;
    signatures[k] = Signature(members_[k].vocabulary().Assign(features[k].descriptors, nearest[k]));
  });
  return signatures;
}

// Steps 3 and 4 of section 1. Returns the slot that now stands for the query.
int LoopDetector::Impl::Remember(const LoopQuery& query, const std::vector<Features>& features,
                                 const std::vector<Signature>& signatures) {
  last_id_ = query.id;
  if (query.features.descriptors.rows > 0) {
    caller_type_ = query.features.descriptors.type();
    caller_width_ = query.features.descriptors.cols;
  }
  views_.push_back(MakeView(query, features, options_.verification));
  const int newest = static_cast<int>(views_.size()) - 1;
  if (!Shared()) union_.Add(query.id);
  bool dropped_by_all = true;
  int stands_for = newest;
  for (auto& system : systems_) {
    const int slot = system->Remember(query.id, signatures);
    if (slot == newest) dropped_by_all = false;
    stands_for = slot;
  }
  if (!Shared()) {
    stands_for = dropped_by_all ? union_.DropNewest() : newest;
    union_.Settle();
  }
  if (dropped_by_all) {
    dropped_view_ = std::move(views_.back());
    views_.back() = View();
  }
  return stands_for;
}

void LoopDetector::Impl::ForEachUnit(const std::function<void(MemorySystem&, std::size_t)>& call) {
  std::vector<std::pair<MemorySystem*, std::size_t>> units;
  for (auto& system : systems_) {
    for (std::size_t u = 0; u < system->units().size(); ++u) units.emplace_back(system.get(), u);
  }
  RunParallel(static_cast<int>(units.size()), options_.threads,
              [&](int i) { call(*units[Index(i)].first, units[Index(i)].second); });
}

CombinedBelief LoopDetector::Impl::CombineUnits() const {
  std::vector<const Belief*> beliefs;
  for (const auto& system : systems_) {
    for (const FilterUnit& unit : system->units()) {
      if (unit.took_part()) beliefs.push_back(&unit.filter.posterior());
    }
  }
  return Combine(options_.rule, beliefs, options_.loop_threshold, memory(), Weights());
}

// Of the beliefs that CombineUnits takes; none for equal ones.
std::vector<double> LoopDetector::Impl::Weights() const {
  constexpr double kLeast = 0.1;  // a member that was never right may come to be
  std::vector<double> weights;
  if (options_.weights == MemberWeights::kEqual) return weights;
  for (const auto& system : systems_) {
    for (const FilterUnit& unit : system->units()) {
      if (!unit.took_part()) continue;
      weights.push_back(options_.weights == MemberWeights::kEntropy
                            ? Certainty(unit.filter.posterior(), system->memory().working_memory())
                            : std::max(kLeast, unit.agreement));
    }
  }
  return weights;
}

const FilterUnit& LoopDetector::Impl::UnitOf(std::size_t member) const {
  for (const auto& system : systems_) {
    for (const FilterUnit& unit : system->units()) {
      if (std::find(unit.members.begin(), unit.members.end(), member) != unit.members.end()) return unit;
    }
  }
  return systems_.front()->units().front();
}

void LoopDetector::Impl::FillOpinions(const std::vector<Features>& features, const CombinedBelief& combined,
                                      LoopResult& result) const {
  const auto by_location = [this](const Belief& belief) {
    std::vector<std::pair<std::int64_t, double>> posterior;
    for (const int slot : memory().working_memory()) {
      posterior.emplace_back(memory().id(slot), PosteriorAt(belief, slot));
    }
    return posterior;
  };
  result.hypothesis = combined.hypothesis;
  if (combined.best >= 0) {
    result.candidate = memory().id(combined.best);
    result.posterior = PosteriorAt(combined.belief, combined.best);
  }
  for (std::size_t k = 0; k < members_.size(); ++k) {
    MemberOpinion opinion;
    opinion.name = members_[k].name();
    opinion.features = static_cast<int>(features[k].keypoints.size());
    opinion.words = members_[k].num_words();
    const FilterUnit& unit = UnitOf(k);
    opinion.took_part = unit.took_part();
    const Belief& posterior = unit.filter.posterior();
    if (unit.took_part()) {
      opinion.hypothesis = posterior.Hypothesis();
      const int best = posterior.Best();
      if (best >= 0) opinion.best = memory().id(best);
      if (combined.best >= 0) opinion.at_candidate = PosteriorAt(posterior, combined.best);
      if (options_.keep_posterior) opinion.posterior_by_location = by_location(posterior);
    }
    result.members.push_back(opinion);
  }
  if (options_.keep_posterior) result.posterior_by_location = by_location(combined.belief);
}

void LoopDetector::Impl::Decide(int slot, const CombinedBelief& combined, LoopResult& result) {
  if (memory().working_memory().empty()) {
    result.reason = "no location is old enough to be a candidate yet";
    return;
  }
  if (combined.best < 0) {
    result.reason = "no member has enough features in this image";
    return;
  }
  const double threshold = std::max(options_.loop_threshold, options_.hypothesis_ratio * last_hypothesis_);
  if (options_.consistent_images > 0) FollowCandidate(combined.best);
  result.proposed = result.hypothesis >= threshold;
  if (result.proposed && candidates_in_a_row_ < options_.consistent_images) {
    result.proposed = false;
    result.reason = "the candidates of the images before lie elsewhere (" +
                    std::to_string(candidates_in_a_row_) + " in a row, " +
                    std::to_string(options_.consistent_images) + " are needed)";
    return;
  }
  if (!result.proposed) {
    char text[128];
    std::snprintf(text, sizeof text, "the hypothesis is too weak (%.3f, the threshold is %.3f)",
                  result.hypothesis, threshold);
    result.reason = text;
    return;
  }
  if (!options_.verification.enabled) {
    result.accepted = true;
    result.verification.candidate = result.candidate;
    result.verification.accepted = true;
    return;
  }
  Verify(memory().id(slot) == result.query ? views_[Index(slot)] : dropped_view_, combined.belief, result);
}

void LoopDetector::Impl::Verify(const View& query, const Belief& belief, LoopResult& result) const {
  const internal::HypothesisSearch search(options_, memory(), verifier_,
                                          [this](int s) -> const View& { return views_[Index(s)]; });
  search.Verify(query, belief, result);
}

// One image by itself, without the images before it: no filter, all places are as likely.
LoopResult LoopDetector::Impl::Locate(const LoopQuery& query) const {
  CheckContent(query);
  LoopResult result;
  result.query = query.id;
  Stopwatch watch;
  const std::vector<Features> features = Extract(query);
  result.extract_ms = watch.LapMs();
  const std::vector<std::vector<TwoNearest>> nearest =
      SearchWords(features, std::vector<char>(members_.size(), 1));
  std::vector<Signature> signatures;
  for (std::size_t k = 0; k < members_.size(); ++k) {
    signatures.emplace_back(members_[k].vocabulary().Recognise(nearest[k]));
  }
  result.quantise_ms = watch.LapMs();
  std::vector<Belief> opinions;
  for (const auto& system : systems_) {
    for (std::size_t u = 0; u < system->units().size(); ++u) {
      Belief opinion = system->Opinion(u, signatures);
      if (!opinion.places.empty()) opinions.push_back(std::move(opinion));
    }
  }
  std::vector<const Belief*> beliefs;
  for (const Belief& opinion : opinions) beliefs.push_back(&opinion);
  const CombinedBelief combined = Combine(options_.rule, beliefs, 0, memory());
  result.likelihood_ms = watch.LapMs();
  if (combined.best < 0) {
    result.reason = "none of its words is known";
    return result;
  }
  result.hypothesis = combined.hypothesis;
  result.candidate = memory().id(combined.best);
  result.posterior = PosteriorAt(combined.belief, combined.best);
  result.proposed = true;
  Verify(MakeView(query, features, options_.verification), combined.belief, result);
  result.verify_ms = watch.LapMs();
  return result;
}

// Counts the images in a row whose candidates lie near that of the image before.
void LoopDetector::Impl::FollowCandidate(int best) {
  constexpr int kLevels = 3;
  const int before = last_candidate_ < 0 ? -1 : memory().Find(last_candidate_);
  const auto near = before < 0 ? std::vector<std::pair<int, int>>() : memory().Neighbours(before, kLevels);
  const bool follows =
      std::any_of(near.begin(), near.end(), [best](const auto& n) { return n.first == best; });
  candidates_in_a_row_ = follows ? candidates_in_a_row_ + 1 : 0;
  last_candidate_ = memory().id(best);
}

void LoopDetector::Impl::CloseLoop(std::int64_t newer, std::int64_t older) {
  if (!Shared()) union_.AddLink(union_.Find(newer), union_.Find(older), LocationMemory::LinkType::kLoop);
  for (auto& system : systems_) {
    system->CloseLoop(system->memory().Find(newer), system->memory().Find(older));
    system->Agree(system->memory().Find(older));
  }
}

LoopDetector::LoopDetector(const LoopDetectorOptions& options) : impl_(std::make_unique<Impl>(options)) {}
LoopDetector::LoopDetector(LoopDetector&&) noexcept = default;
LoopDetector& LoopDetector::operator=(LoopDetector&&) noexcept = default;
LoopDetector::~LoopDetector() = default;

LoopResult LoopDetector::Detect(const LoopQuery& query) { return impl_->Detect(query); }

LoopResult LoopDetector::Detect(const cv::Mat& image, std::int64_t id) {
  LoopQuery query;
  query.id = id;
  query.image = image;
  return impl_->Detect(query);
}

LoopResult LoopDetector::Locate(const LoopQuery& query) const { return impl_->Locate(query); }

void LoopDetector::AddLink(std::int64_t a, std::int64_t b) { impl_->AddLink(a, b); }
void LoopDetector::Save(const std::filesystem::path& file) const { impl_->Save(file); }

std::size_t LoopDetector::NumLocations() const {
  const LocationMemory& memory = impl_->memory();
  return memory.short_term_memory().size() + memory.working_memory().size();
}
std::size_t LoopDetector::NumLongTerm() const {
  return static_cast<std::size_t>(impl_->memory().num_long_term());
}
std::int64_t LoopDetector::LastId() const { return impl_->last_id(); }
const LoopDetectorOptions& LoopDetector::options() const { return impl_->options(); }

}  // namespace tutti
