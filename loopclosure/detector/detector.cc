#include "tutti/loopclosure/detector.h"

#include <algorithm>
#include <utility>

#include "core/numbers.h"
#include "core/stopwatch.h"
#include "loopclosure/detector/detector_file.h"
#include "loopclosure/detector/detector_state.h"
#include "loopclosure/detector/ensemble.h"
#include "loopclosure/detector/hypothesis_search.h"
#include "loopclosure/detector/long_term_memory.h"
#include "loopclosure/geometry/verification.h"
#include "tutti/core/error.h"

namespace tutti {

const char* ToString(ConstraintType type) {
  switch (type) {
    case ConstraintType::kNone:
      return "none";
    case ConstraintType::kFundamental:
      return "fundamental";
    case ConstraintType::kEssential:
      return "essential";
    case ConstraintType::kRigid:
      return "rigid";
    case ConstraintType::kSimilarity:
      return "similarity";
  }
  return "?";
}

/// What happens to an image.
class LoopDetector::Impl {
 public:
  explicit Impl(const LoopDetectorOptions& options)
      : state_(options),
        long_term_(state_),
        search_(
            state_.options(), state_.memory(),
            [verifier = GeometricVerifier(options.verification, options.seed)](
                const View& a, const View& b, int threads) { return verifier.Verify(a, b, threads); },
            [this](int slot) -> const View& { return state_.view(slot); }) {}

  LoopResult Detect(const LoopQuery& query);
  LoopResult Locate(const LoopQuery& query) const;

  internal::DetectorState& state() { return state_; }
  internal::LongTermMemory& long_term() { return long_term_; }

 private:
  void FillCounts(const std::vector<Features>& features, LoopResult& result) const;
  void Verify(const View& query, const Belief& belief, LoopResult& result) const;

  internal::DetectorState state_;
  internal::LongTermMemory long_term_;
  internal::HypothesisSearch search_;
};

LoopResult LoopDetector::Impl::Detect(const LoopQuery& query) {
  internal::CheckId(query.id, state_.last_id(), state_.options().ltm_file);
  internal::CheckQuery(query, state_.members(), state_.callers_descriptors());
  LoopResult result;
  result.query = query.id;
  internal::Stopwatch watch;

  const std::vector<Features> features = state_.ensemble().Extract(query);
  View extracted = MakeView(query, features, state_.options().verification);
  result.extract_ms = watch.LapMs();

  const std::vector<SeenWords> words = state_.ensemble().Quantise(features, extracted.size);
  result.quantise_ms = watch.LapMs();

  const View& view = state_.Remember(query, std::move(extracted), words);
  result.memory_ms = watch.LapMs();

  const CombinedBelief combined = state_.reasoner().Step(result);
  FillCounts(features, result);
  watch.LapMs();

  result.proposed = state_.reasoner().Proposes(combined, result);
  if (result.proposed) Verify(view, combined.belief, result);
  state_.reasoner().VerifyAgain(search_, result);
  result.verify_ms = watch.LapMs();

  state_.reasoner().Finish(result);
  const int hypothesis = result.hypothesis > 0.0 ? combined.best : -1;  // 0: the members do not agree on one
  long_term_.Retrieve(hypothesis, result);
  long_term_.Shrink(hypothesis, watch.Milliseconds(), result);
  long_term_.Record(result);
  result.memory_ms += watch.LapMs();
  return result;
}

void LoopDetector::Impl::FillCounts(const std::vector<Features>& features, LoopResult& result) const {
  for (std::size_t k = 0; k < features.size(); ++k) {
    result.members[k].features = features[k].descriptors.rows;
    result.members[k].words = state_.members()[k].num_words();
  }
}

void LoopDetector::Impl::Verify(const View& query, const Belief& belief, LoopResult& result) const {
  const bool has_features = std::any_of(query.members.begin(), query.members.end(),
                                        [](const View::Set& set) { return !set.pixels.empty(); });
  if (state_.options().verification.enabled && state_.ensemble().all_dense() && !has_features &&
      query.caller.pixels.empty()) {
    result.reason =
        "there are no features for the geometry: dense members have none; add another member, give "
        "features with the query, or set verification.enabled: false";
    return;
  }
  state_.reasoner().Verify(query, belief, search_, result);
}

// One image by itself, without the images before it: no filter, all places are as likely.
LoopResult LoopDetector::Impl::Locate(const LoopQuery& query) const {
  internal::CheckQuery(query, state_.members(), state_.callers_descriptors());
  LoopResult result;
  result.query = query.id;
  internal::Stopwatch watch;
  const std::vector<Features> features = state_.ensemble().Extract(query);
  const View view = MakeView(query, features, state_.options().verification);
  result.extract_ms = watch.LapMs();
  const std::vector<SeenWords> words = state_.ensemble().Recognise(features, view.size);
  result.quantise_ms = watch.LapMs();
  const CombinedBelief combined = state_.reasoner().Locate(words);
  result.likelihood_ms = watch.LapMs();
  if (combined.best < 0) {
    result.reason = "none of its words is known";
    return result;
  }
  result.hypothesis = combined.hypothesis;
  result.candidate = result.best = state_.memory().id(combined.best);
  result.posterior = internal::PosteriorAt(combined.belief, combined.best);
  result.proposed = true;
  Verify(view, combined.belief, result);
  result.verify_ms = watch.LapMs();
  return result;
}

LoopDetector::LoopDetector(const LoopDetectorOptions& options) : impl_(std::make_unique<Impl>(options)) {
  impl_->long_term().Open();
}
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

void LoopDetector::BeginSession() { impl_->state().reasoner().Interrupt(); }
void LoopDetector::ForgetPositions() { impl_->state().reasoner().track().Forget(); }

std::vector<LoopPlace> LoopDetector::Places() const {
  const internal::DetectorState& state = impl_->state();
  for (const Member& member : state.members()) {
    if (member.dense())
      throw InputError("member '" + member.name() +
                       "' describes images as a whole: its places can't be shown "
                       "to another detector");
  }
  std::vector<LoopPlace> places;
  for (int slot = 0; slot < state.memory().size(); ++slot) {
    if (state.memory().state(slot) == LocationState::kMerged) continue;
    const View view = state.HasView(slot) ? state.view(slot) : impl_->long_term().ViewOf(slot);
    LoopPlace place;
    place.id = view.id;
    place.camera = view.camera;
    for (std::size_t m = 0; m < view.members.size(); ++m) {
      Features& features = place.member_features[state.members()[m].name()];
      cv::KeyPoint::convert(view.members[m].pixels, features.keypoints);
      features.descriptors = view.members[m].descriptors.Unpacked();
    }
    places.push_back(std::move(place));
  }
  return places;
}

void LoopDetector::AddLink(std::int64_t a, std::int64_t b) { impl_->state().reasoner().AddLink(a, b); }
void LoopDetector::Unlink(std::int64_t a, std::int64_t b) { impl_->state().reasoner().Unlink(a, b); }

bool LoopDetector::Merge(std::int64_t id, std::int64_t into) {
  internal::DetectorState& state = impl_->state();
  const int slot = state.memory().Find(id);
  if (slot < 0 || state.memory().Find(into) < 0) return false;
  if (state.memory().id(slot) != id) return true;  // rehearsal has merged it already
  if (!state.reasoner().Replace(slot, into)) return false;
  state.DropView(slot);
  return true;
}

void LoopDetector::Save(const std::filesystem::path& file) const {
  internal::SaveDetector(impl_->state(), impl_->long_term(), file);
}

void LoopDetector::SaveSections(
    const std::function<void(std::uint32_t tag, std::string_view bytes)>& sink) const {
  internal::SaveDetector(impl_->state(), impl_->long_term(), internal::Positions::kKeep, sink);
}

void LoopDetector::Load(const std::filesystem::path& file) {
  internal::SavedDetector saved(file);
  Take(&saved);
}

void LoopDetector::LoadSections(internal::SectionReader* file) {
  internal::SavedDetector saved(file);
  Take(&saved);
}

void LoopDetector::Take(internal::SavedDetector* saved) {
  LoopDetectorOptions options = impl_->state().options();
  options.seed = saved->seed();
  auto loaded = std::make_unique<Impl>(options);
  saved->LoadInto(loaded->state(), loaded->long_term());
  loaded->long_term().TakeFile(impl_->long_term());
  impl_ = std::move(loaded);
}

std::size_t LoopDetector::NumLocations() const {
  const LocationMemory& memory = impl_->state().memory();
  return memory.short_term_memory().size() + memory.working_memory().size();
}
std::size_t LoopDetector::NumLongTerm() const {
  return internal::Index(impl_->state().memory().num_long_term());
}
std::int64_t LoopDetector::LastId() const { return impl_->state().last_id(); }
const LoopDetectorOptions& LoopDetector::options() const { return impl_->state().options(); }

}  // namespace tutti
