#include "tutti/loopclosure/detector.h"

#include <algorithm>
#include <cmath>

#include "core/stopwatch.h"
#include "loopclosure/detector/detector_impl.h"
#include "loopclosure/detector/parallel.h"
#include "loopclosure/memory/dense.h"
#include "tutti/core/error.h"

namespace tutti {

namespace {

std::vector<Member> MembersOf(const LoopDetectorOptions& options) {
  const std::string problem = options.Validate();
  if (!problem.empty()) throw InputError("loop-closure options: " + problem);
  std::vector<Member> members;
  members.reserve(options.members.size());
  for (std::size_t k = 0; k < options.members.size(); ++k) {
    members.emplace_back(options.members[k], options, options.seed * 1000003u + k);
  }
  return members;
}

// Of a dense member.
SeenWords Described(const Features& features) {
  SeenWords seen;
  seen.descriptor = NormalisedDescriptor(features.descriptors);
  return seen;
}

SeenWords Placed(std::vector<int> words, const std::vector<cv::KeyPoint>& keypoints, const cv::Size& size) {
  SeenWords seen;
  seen.words = std::move(words);
  seen.cells.reserve(seen.words.size());
  for (std::size_t i = 0; i < seen.words.size(); ++i)
    seen.cells.push_back(SeenWords::Cell(keypoints[i].pt, size));
  return seen;
}

}  // namespace

LoopDetector::Impl::Impl(const LoopDetectorOptions& options, std::unique_ptr<internal::LocationStore> store)
    : options_(options),
      members_(MembersOf(options)),
      reasoner_(options_, members_),
      verifier_(options.verification, options.seed),
      store_(std::move(store)) {
  unstored_nodes_.resize(systems().size() + 1);
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
  internal::Stopwatch watch;

  const std::vector<Features> features = Extract(query);
  View view = MakeView(query, features, options_.verification);
  result.extract_ms = watch.LapMs();

  const std::vector<SeenWords> words = Quantise(features, view.size);
  result.quantise_ms = watch.LapMs();

  const int slot = Remember(query, std::move(view), words);
  result.memory_ms = watch.LapMs();

  const CombinedBelief combined = reasoner_.Step(result);
  FillCounts(features, result);
  watch.LapMs();

  Decide(slot, combined, result);
  result.verify_ms = watch.LapMs();

  reasoner_.Finish(result);
  const int hypothesis = result.hypothesis > 0.0 ? combined.best : -1;  // 0: the members do not agree on one
  Retrieve(hypothesis, result);
  Shrink(hypothesis, watch.Milliseconds(), result);
  Journal(static_cast<int>(views_.size()) - 1, result);
  result.memory_ms += watch.LapMs();
  return result;
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
      features[Index(k)] = members_[Index(k)].Extract(query.image, grey, query.mask);
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
    if (usable[k] == 0 || members_[k].dense()) continue;
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
std::vector<SeenWords> LoopDetector::Impl::Quantise(const std::vector<Features>& features,
                                                    const cv::Size& size) {
  std::vector<char> usable(members_.size());
  for (std::size_t k = 0; k < members_.size(); ++k) usable[k] = members_[k].Judge(features[k]) ? 1 : 0;
  const std::vector<std::vector<TwoNearest>> nearest = SearchWords(features, usable);
  std::vector<SeenWords> words(members_.size());
  RunParallel(static_cast<int>(members_.size()), options_.threads, [&](int i) {
    const std::size_t k = Index(i);
    if (usable[k] == 0) return;
    if (members_[k].dense()) {
      words[k] = Described(features[k]);
      return;
    }
    words[k] = Placed(members_[k].vocabulary().Assign(features[k].descriptors, nearest[k]),
                      features[k].keypoints, size);
  });
  return words;
}

// Steps 3 and 4 of section 1. Returns the slot that now stands for the query.
int LoopDetector::Impl::Remember(const LoopQuery& query, View view, const std::vector<SeenWords>& words) {
  last_id_ = query.id;
  if (query.features.descriptors.rows > 0) {
    caller_type_ = query.features.descriptors.type();
    caller_width_ = query.features.descriptors.cols;
  }
  views_.push_back(std::move(view));
  const int newest = static_cast<int>(views_.size()) - 1;
  const int stands_for = reasoner_.Remember(query.id, words, query.pose_prior);
  if (stands_for != newest) {
    dropped_view_ = std::move(views_.back());
    views_.back() = View();
  }
  return stands_for;
}

void LoopDetector::Impl::FillCounts(const std::vector<Features>& features, LoopResult& result) const {
  for (std::size_t k = 0; k < members_.size(); ++k) {
    result.members[k].features = features[k].descriptors.rows;
    result.members[k].words = members_[k].num_words();
  }
}

void LoopDetector::Impl::Decide(int slot, const CombinedBelief& combined, LoopResult& result) {
  result.proposed = reasoner_.Proposes(combined, result);
  if (!result.proposed) return;
  Verify(memory().id(slot) == result.query ? views_[Index(slot)] : dropped_view_, combined.belief, result);
}

void LoopDetector::Impl::Verify(const View& query, const Belief& belief, LoopResult& result) const {
  const bool has_features = std::any_of(query.members.begin(), query.members.end(),
                                        [](const View::Set& set) { return !set.pixels.empty(); });
  const bool all_dense =
      std::all_of(members_.begin(), members_.end(), [](const Member& member) { return member.dense(); });
  if (options_.verification.enabled && all_dense && !has_features && query.caller.pixels.empty()) {
    result.reason =
        "there are no features for the geometry: dense members have none; add another member, give "
        "features with the query, or set verification.enabled: false";
    return;
  }
  reasoner_.Verify(
      query, belief,
      [this](const View& a, const View& b, int threads) { return verifier_.Verify(a, b, threads); },
      [this](int s) -> const View& { return views_[Index(s)]; }, result);
}

// One image by itself, without the images before it: no filter, all places are as likely.
LoopResult LoopDetector::Impl::Locate(const LoopQuery& query) const {
  CheckContent(query);
  LoopResult result;
  result.query = query.id;
  internal::Stopwatch watch;
  const std::vector<Features> features = Extract(query);
  const View view = MakeView(query, features, options_.verification);
  result.extract_ms = watch.LapMs();
  const std::vector<std::vector<TwoNearest>> nearest =
      SearchWords(features, std::vector<char>(members_.size(), 1));
  std::vector<SeenWords> words;
  for (std::size_t k = 0; k < members_.size(); ++k) {
    words.push_back(members_[k].dense() ? Described(features[k])
                                        : Placed(members_[k].vocabulary().Recognise(nearest[k]),
                                                 features[k].keypoints, view.size));
  }
  result.quantise_ms = watch.LapMs();
  const CombinedBelief combined = reasoner_.Locate(words);
  result.likelihood_ms = watch.LapMs();
  if (combined.best < 0) {
    result.reason = "none of its words is known";
    return result;
  }
  result.hypothesis = combined.hypothesis;
  result.candidate = result.best = memory().id(combined.best);
  result.posterior = internal::PosteriorAt(combined.belief, combined.best);
  result.proposed = true;
  Verify(view, combined.belief, result);
  result.verify_ms = watch.LapMs();
  return result;
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
void LoopDetector::Unlink(std::int64_t a, std::int64_t b) { impl_->Unlink(a, b); }
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
