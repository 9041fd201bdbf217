#include "tutti/loopclosure/detector.h"

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "tutti/core/error.h"
#include "tutti/loopclosure/bayes_filter.h"
#include "tutti/loopclosure/combination.h"
#include "tutti/loopclosure/likelihood.h"
#include "tutti/loopclosure/location_memory.h"
#include "tutti/loopclosure/member.h"
#include "tutti/loopclosure/parallel.h"
#include "tutti/loopclosure/verification.h"

namespace tutti {
namespace {

class Stopwatch {
 public:
  double LapMs() {
    const auto now = std::chrono::steady_clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - start_).count();
    start_ = now;
    return ms;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// One Bayes filter and the members whose signatures it sees: one each for mean, product, majority and single;
// all of them, concatenated, for naive (loop-closure.md eq. 3).
struct FilterUnit {
  explicit FilterUnit(std::vector<std::size_t> sources, LikelihoodKind kind)
      : members(std::move(sources)), likelihood(kind) {}
  std::vector<std::size_t> members;
  LikelihoodModel likelihood;
  BayesFilter filter;
  bool took_part = false;
};

// d_1 + d_2 + ...: words of different members stay apart by interleaving their ids.
Signature Concatenate(const std::vector<Signature>& signatures, const std::vector<std::size_t>& members) {
  if (members.size() == 1) return signatures[members.front()];
  const int stride = static_cast<int>(members.size());
  std::vector<int> words;
  for (int k = 0; k < stride; ++k) {
    for (const Signature::Entry& entry : signatures[members[static_cast<std::size_t>(k)]].entries()) {
      words.insert(words.end(), static_cast<std::size_t>(entry.count), entry.word * stride + k);
    }
  }
  return Signature(std::move(words));
}

}  // namespace

class LoopDetector::Impl {
 public:
  explicit Impl(const LoopDetectorOptions& options)
      : options_(options),
        memory_(options.stm_size),
        transition_(options.virtual_place_prior),
        verifier_(options.verification, options.seed) {
    const std::string problem = options.Validate();
    if (!problem.empty()) throw InputError("loop-closure options: " + problem);
    for (std::size_t k = 0; k < options.members.size(); ++k) {
      members_.emplace_back(options.members[k], options, options.seed * 1000003u + k);
    }
    std::vector<std::size_t> all(members_.size());
    for (std::size_t k = 0; k < all.size(); ++k) all[k] = k;
    if (options.rule == CombinationRule::kNaive) {
      units_.emplace_back(all, options.likelihood);
    } else {
      for (const std::size_t k : all) units_.emplace_back(std::vector<std::size_t>{k}, options.likelihood);
    }
  }

  LoopResult Detect(const LoopQuery& query) {
    CheckQuery(query);
    LoopResult result;
    result.query = query.id;
    Stopwatch watch;

    const cv::Mat grey = ToGrey8(query.image);
    std::vector<Features> features(members_.size());
    RunParallel(static_cast<int>(members_.size()), options_.threads,
                [&](int k) { features[Index(k)] = members_[Index(k)].Extract(grey); });
    result.extract_ms = watch.LapMs();

    std::vector<Signature> signatures(members_.size());
    RunParallel(static_cast<int>(members_.size()), options_.threads,
                [&](int k) { signatures[Index(k)] = members_[Index(k)].Quantise(features[Index(k)]); });
    result.quantise_ms = watch.LapMs();

    const int slot = Remember(query, features, signatures);
    result.memory_ms = watch.LapMs();

    const std::vector<Belief> likelihoods = Likelihoods(signatures);
    result.likelihood_ms = watch.LapMs();

    std::vector<const Belief*> beliefs;
    for (std::size_t u = 0; u < units_.size(); ++u) {
      if (!units_[u].took_part) continue;
      units_[u].filter.Step(transition_, memory_.working_memory(), likelihoods[u]);
      beliefs.push_back(&units_[u].filter.posterior());
    }
    const CombinedBelief combined = Combine(options_.rule, beliefs, options_.loop_threshold, memory_);
    FillOpinions(features, combined, result);
    result.filter_ms = watch.LapMs();

    Decide(slot, combined, result);
    result.verify_ms = watch.LapMs();
    if (result.accepted) CloseLoop(slot, memory_.Find(result.verification.candidate));
    result.memory_ms += watch.LapMs();
    return result;
  }

  void AddLink(std::int64_t a, std::int64_t b) {
    const int slot_a = memory_.Find(a);
    const int slot_b = memory_.Find(b);
    for (const auto& [id, slot] : {std::make_pair(a, slot_a), std::make_pair(b, slot_b)}) {
      if (slot < 0) throw InputError("AddLink: there is no location with id " + std::to_string(id));
    }
    if (memory_.AddLink(slot_a, slot_b, LocationMemory::LinkType::kOdometry)) {
      transition_.Update(memory_, {slot_a, slot_b});
    }
  }

  std::size_t NumLocations() const {
    return memory_.short_term_memory().size() + memory_.working_memory().size();
  }
  const LoopDetectorOptions& options() const { return options_; }

 private:
  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }

  void CheckQuery(const LoopQuery& query) {
    const std::string which = "location " + std::to_string(query.id) + ": ";
    if (memory_.size() > 0 && query.id <= last_id_) {
      throw InputError(which + "ids must grow, but the one before was " + std::to_string(last_id_));
    }
    const FeatureSet& f = query.features;
    const std::size_t n = f.keypoints.size();
    if (static_cast<std::size_t>(f.descriptors.rows) != n) {
      throw InputError(which + std::to_string(n) + " keypoints but " + std::to_string(f.descriptors.rows) +
                       " descriptor rows");
    }
    if (!f.points.empty() && f.points.size() != n) {
      throw InputError(which + std::to_string(n) + " keypoints but " + std::to_string(f.points.size()) +
                       " points; give none or one each (NaN where unknown)");
    }
    if (n > 0) {
      if (f.descriptors.type() != CV_8U && f.descriptors.type() != CV_32F) {
        throw InputError(which + "descriptors must be CV_8U (Hamming) or CV_32F (Euclidean)");
      }
      if (caller_type_ >= 0 &&
          (f.descriptors.type() != caller_type_ || f.descriptors.cols != caller_width_)) {
        throw InputError(
            which + "descriptors are of another type or width than before; give every image the same kind");
      }
      caller_type_ = f.descriptors.type();
      caller_width_ = f.descriptors.cols;
    }
    if (!query.depth_m.empty() &&
        (query.depth_m.type() != CV_32FC1 || query.depth_m.size() != query.image.size())) {
      throw InputError(which + "depth_m must be CV_32FC1 in metres and as large as the image");
    }
    if (query.camera) {
      const std::string problem = query.camera->Validate();
      if (!problem.empty()) throw InputError(which + problem);
    }
    last_id_ = query.id;
  }

  // Steps 3 and 4 of section 1: into STM, rehearsal, STM -> WM. Returns the slot that now stands for the
  // query.
  int Remember(const LoopQuery& query, const std::vector<Features>& features,
               const std::vector<Signature>& signatures) {
    int slot = memory_.Add(query.id);
    views_.push_back(MakeView(query, features, options_.verification));
    for (FilterUnit& unit : units_) {
      const Signature signature = Concatenate(signatures, unit.members);
      unit.took_part = !signature.empty();
      unit.likelihood.Add(signature);
    }
    if (options_.rehearsal && slot > 0 && Similar(signatures, last_signatures_)) {
      const int merged = memory_.DropNewest();
      if (merged >= 0) {
        for (FilterUnit& unit : units_) unit.likelihood.Remove(slot);
        dropped_view_ = std::move(views_.back());
        views_.back() = View();
        slot = merged;
      }
    }
    last_signatures_ = signatures;
    transition_.Update(memory_, memory_.Settle());
    return slot;
  }

  bool Similar(const std::vector<Signature>& a, const std::vector<Signature>& b) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < a.size() && k < b.size(); ++k) sum += Signature::Similarity(a[k], b[k]);
    return !b.empty() && sum / static_cast<double>(a.size()) >= options_.rehearsal_similarity;
  }

  std::vector<Belief> Likelihoods(const std::vector<Signature>& signatures) const {
    std::vector<Belief> likelihoods(units_.size());
    RunParallel(static_cast<int>(units_.size()), options_.threads, [&](int u) {
      const FilterUnit& unit = units_[Index(u)];
      if (!unit.took_part) return;
      const std::vector<double> scores = unit.likelihood.Scores(Concatenate(signatures, unit.members));
      likelihoods[Index(u)] = AdjustLikelihood(scores, memory_.working_memory());
    });
    return likelihoods;
  }

  void FillOpinions(const std::vector<Features>& features, const CombinedBelief& combined,
                    LoopResult& result) const {
    result.hypothesis = combined.hypothesis;
    if (combined.best >= 0) {
      result.candidate = memory_.id(combined.best);
      result.posterior = combined.belief.places[Index(combined.best)];
    }
    for (std::size_t k = 0; k < members_.size(); ++k) {
      MemberOpinion opinion;
      opinion.name = members_[k].name();
      opinion.features = static_cast<int>(features[k].keypoints.size());
      opinion.words = members_[k].num_words();
      const FilterUnit& unit = units_[units_.size() == members_.size() ? k : 0];
      opinion.took_part = unit.took_part;
      const Belief& posterior = unit.filter.posterior();
      if (unit.took_part) {
        opinion.hypothesis = posterior.Hypothesis();
        const int best = posterior.Best();
        if (best >= 0) opinion.best = memory_.id(best);
        if (combined.best >= 0) opinion.at_candidate = posterior.places[Index(combined.best)];
        if (options_.keep_posterior) opinion.posterior_by_location = ByLocation(posterior);
      }
      result.members.push_back(opinion);
    }
    if (options_.keep_posterior) result.posterior_by_location = ByLocation(combined.belief);
  }

  // Pairs of id and probability for all of working memory.
  std::vector<std::pair<std::int64_t, double>> ByLocation(const Belief& belief) const {
    std::vector<std::pair<std::int64_t, double>> all;
    for (const int slot : memory_.working_memory())
      all.emplace_back(memory_.id(slot), PosteriorAt(belief, slot));
    return all;
  }

  // 0 for a place that the belief does not reach.
  static double PosteriorAt(const Belief& belief, int slot) {
    return Index(slot) < belief.places.size() ? belief.places[Index(slot)] : 0.0;
  }

  // Best places by posterior, apart from each other, best first.
  std::vector<int> TopPlaces(const Belief& belief) const {
    std::vector<int> order;
    for (const int slot : memory_.working_memory()) {
      if (PosteriorAt(belief, slot) > 0.0) order.push_back(slot);
    }
    const std::size_t wanted = Index(options_.verification.max_hypotheses);
    // Within a place its neighbours follow closely: look at enough of the best to find `wanted` places.
    const std::size_t looked_at = std::min(order.size(), wanted * (2 * Index(TransitionModel::kLevels) + 1));
    std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(looked_at), order.end(),
                      [&](int a, int b) {
                        const double pa = belief.places[Index(a)];
                        const double pb = belief.places[Index(b)];
                        return pa != pb ? pa > pb : a > b;
                      });
    order.resize(looked_at);
    std::vector<int> places;
    std::vector<int> covered;
    for (const int slot : order) {
      if (places.size() == wanted) break;
      if (std::find(covered.begin(), covered.end(), slot) != covered.end()) continue;
      places.push_back(slot);
      for (const auto& [near, level] : memory_.Neighbours(slot, 1 + options_.verification.neighbours)) {
        covered.push_back(near);
      }
    }
    return places;
  }

  void Decide(int slot, const CombinedBelief& combined, LoopResult& result) {
    if (memory_.working_memory().empty()) {
      result.reason = "no location is old enough to be a candidate yet";
      return;
    }
    if (combined.best < 0) {
      result.reason = "no member has enough features in this image";
      return;
    }
    result.proposed = result.hypothesis >= options_.loop_threshold;
    if (!result.proposed) {
      char text[128];
      std::snprintf(text, sizeof text, "the hypothesis is too weak (%.3f, the threshold is %.3f)",
                    result.hypothesis, options_.loop_threshold);
      result.reason = text;
      return;
    }
    if (!options_.verification.enabled) {
      result.accepted = true;
      result.verification.candidate = result.candidate;
      result.verification.accepted = true;
      return;
    }
    const View& query = memory_.id(slot) == result.query ? views_[Index(slot)] : dropped_view_;
    Verify(query, combined.belief, result);
  }

  // Tries a candidate unless it was tried before; keeps it as the best if it is.
  const Verification& Try(const View& query, int candidate, LoopResult& result) {
    const std::int64_t id = memory_.id(candidate);
    for (const Verification& before : result.tried) {
      if (before.candidate == id) return before;
    }
    result.tried.push_back(verifier_.Verify(query, views_[Index(candidate)], options_.threads));
    const Verification& tried = result.tried.back();
    const Verification& best = result.verification;
    const bool first = result.tried.size() == 1;
    if (first || (tried.accepted && !best.accepted) ||
        (tried.accepted == best.accepted && tried.inliers > best.inliers)) {
      result.verification = tried;
    }
    return tried;
  }

  void Verify(const View& query, const Belief& belief, LoopResult& result) {
    const VerificationOptions& options = options_.verification;
    const std::vector<int> places = TopPlaces(belief);
    for (const int place : places) {
      int inliers_here = 0;
      for (const int candidate : ViewsOf(place, belief)) {
        // Neighbours are worth a try where the place itself shows something, or for the best hypothesis.
        if (candidate != place && place != places.front() && inliers_here < options.min_inliers / 2) break;
        inliers_here = std::max(inliers_here, Try(query, candidate, result).inliers);
        if (result.verification.accepted) break;
      }
      if (result.verification.accepted) break;
    }
    result.accepted = result.verification.accepted;
    if (result.accepted) {
      Climb(query, result);
    } else {
      result.reason = result.verification.reason;
    }
  }

  // The place itself, then the best of its neighbours by posterior. A place that was visited often has many,
  // which show the same.
  std::vector<int> ViewsOf(int place, const Belief& belief) const {
    constexpr std::size_t kMostNeighbours = 3;
    std::vector<int> views;
    for (const auto& [slot, level] : memory_.Neighbours(place, options_.verification.neighbours)) {
      if (slot != place) views.push_back(slot);
    }
    std::stable_sort(views.begin(), views.end(),
                     [&](int a, int b) { return PosteriorAt(belief, a) > PosteriorAt(belief, b); });
    if (views.size() > kMostNeighbours) views.resize(kMostNeighbours);
    views.insert(views.begin(), place);
    return views;
  }

  // From an accepted candidate along the path to the neighbour that shares the most with the query: the
  // nearest view of the place, and the best constraint.
  void Climb(const View& query, LoopResult& result) {
    constexpr int kSteps = 3;
    for (int step = 0; step < kSteps; ++step) {
      const std::int64_t start = result.verification.candidate;
      for (const LocationMemory::Link& link : memory_.links(memory_.Find(start))) {
        if (link.type == LocationMemory::LinkType::kOdometry &&
            memory_.state(link.slot) == LocationMemory::State::kWorking)
          Try(query, link.slot, result);
      }
      if (result.verification.candidate == start) return;
    }
  }

  void CloseLoop(int newer, int older) {
    if (older < 0 || newer == older) return;
    if (memory_.AddLink(newer, older, LocationMemory::LinkType::kLoop))
      transition_.Update(memory_, {newer, older});
    memory_.TransferWeight(newer, older);
  }

  LoopDetectorOptions options_;
  std::vector<Member> members_;
  std::vector<FilterUnit> units_;
  LocationMemory memory_;
  TransitionModel transition_;
  GeometricVerifier verifier_;
  std::vector<View> views_;  // by slot
  View dropped_view_;        // of a query that rehearsal has just merged away
  std::vector<Signature> last_signatures_;
  std::int64_t last_id_ = 0;
  int caller_type_ = -1;
  int caller_width_ = 0;
};

LoopDetector::LoopDetector(const LoopDetectorOptions& options) : impl_(std::make_unique<Impl>(options)) {}
LoopDetector::LoopDetector(LoopDetector&&) noexcept = default;
LoopDetector& LoopDetector::operator=(LoopDetector&&) noexcept = default;
LoopDetector::~LoopDetector() = default;

LoopResult LoopDetector::Detect(const LoopQuery& query) { return impl_->Detect(query); }
void LoopDetector::AddLink(std::int64_t a, std::int64_t b) { impl_->AddLink(a, b); }
std::size_t LoopDetector::NumLocations() const { return impl_->NumLocations(); }
const LoopDetectorOptions& LoopDetector::options() const { return impl_->options(); }

}  // namespace tutti
