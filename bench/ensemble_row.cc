#include "bench/ensemble_row.h"

#include <algorithm>
#include <random>

#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::bench {
namespace {

using Json = nlohmann::ordered_json;

// A member that is broken: its counts are those of other places.
void Shuffle(std::int64_t image, std::vector<double>& counts) {
  std::mt19937_64 random(static_cast<std::uint64_t>(image) * 7919u + 17u);
  std::shuffle(counts.begin(), counts.end(), random);
}

Json RecallParts(const std::vector<RecallPart>& parts) {
  Json json = Json::array();
  for (const RecallPart& p : parts) json.push_back({p.from, p.to, p.rows, p.found, p.found_at_100_precision});
  return json;
}

// A letter an image: what became of it at the default decision.
std::string Letters(const std::vector<LoopOutcome>& outcomes, const LoopGroundTruth& truth,
                    const std::vector<LoopObservation>& observations) {
  std::string letters;
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    const LoopObservation& o = observations[i];
    const bool near = o.accepted && truth.At(o.image, o.verified) == LoopLabel::kIgnore;
    const bool missed = truth.HasLoop(o.image);
    switch (outcomes[i]) {
      case LoopOutcome::kTruePositive:
        letters += 'T';
        break;
      case LoopOutcome::kFalsePositive:
        letters += missed ? 'X' : 'F';  // a wrong place, where there is a right one, or none
        break;
      default:
        letters += near ? (missed ? 'n' : 'i') : missed ? 'm' : '.';
    }
  }
  return letters;
}

}  // namespace

Verification PairCache::Verify(const View& query, const View& candidate, double& ms) {
  const auto key = std::make_pair(query.id, candidate.id);
  auto found = done_.find(key);
  if (found == done_.end()) {
    const auto begin = std::chrono::steady_clock::now();
    Verification verification = verifier_.Verify(query, candidate, 1);
    const double took = MillisecondsSince(begin);
    found = done_.emplace(key, std::make_pair(std::move(verification), took)).first;
  }
  ms += found->second.second;
  return found->second.first;
}

RowName::RowName(const std::string& name) {
  std::vector<std::string> parts = SplitText(name, "/");
  for (std::size_t k = 1; k < parts.size(); ++k) {
    const std::size_t equals = parts[k].find('=');
    const std::string key = parts[k].substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : parts[k].substr(equals + 1);
    if (key == "shuffle")
      shuffle = value;
    else if (key == "false-links")
      false_links = std::atoi(value.c_str());
    else
      throw InputError("row " + name + ": nothing is called " + key);
  }
  const std::size_t colon = parts.front().find(':');
  rule = parts.front().substr(0, colon);
  if (colon != std::string::npos) members = parts.front().substr(colon + 1);
}

Row::Row(const std::string& name, const std::vector<std::string>& names, bool posterior_only, int images)
    : name_(name), parts_(name), posterior_only_(posterior_only), images_(images) {
  std::string rule = parts_.rule;
  if (rule == "seed") {
    ApplyPreset("standardised-mean", options_);
    rule = "mean";
  }
  SetRule(rule, options_);
  options_.threads = 1;
  options_.wm_limit = 0;
  std::vector<std::string> chosen = parts_.members.empty() ? names : SplitText(parts_.members, "+");
  if (options_.rule == CombinationRule::kSingle) chosen = {rule};
  for (const std::string& member : chosen) {
    const auto found = std::find(names.begin(), names.end(), member);
    if (found == names.end())
      throw InputError(
          std::string("row ").append(name).append(": no member '").append(member).append("' in --members"));
    members_.push_back(static_cast<std::size_t>(found - names.begin()));
    shells_.emplace_back(BaseName(member), options_, 1);
  }
  options_.members = chosen;
  reasoner_ = std::make_unique<internal::PlaceReasoner>(options_, shells_);
}

// The steps of LoopDetector::Detect behind the words. `verify_ms`: what verification takes, `cached_ms`: what
// it took here, where another row may have asked before.
LoopResult Row::Detect(std::int64_t image, const std::vector<Percept>& percepts, PairCache& pairs,
                       double& verify_ms, double& cached_ms) {
  std::vector<SeenWords> words;
  for (const std::size_t k : members_) words.push_back(percepts.back().words[k]);
  LoopResult result;
  result.query = image;
  reasoner_->Remember(image, words);
  const CombinedBelief combined = reasoner_->Step(result, [&](std::size_t u, internal::FilterUnit& unit) {
    if (options_.members[u] == parts_.shuffle) Shuffle(image, unit.counts);
  });
  result.proposed = reasoner_->Proposes(combined, result);
  if (!posterior_only_) {
    const auto begin = std::chrono::steady_clock::now();
    const auto verify = [&](const View& a, const View& b, int) { return pairs.Verify(a, b, verify_ms); };
    const auto view_of = [&](int slot) -> const View& {
      return percepts[static_cast<std::size_t>(slot)].view;
    };
    const internal::HypothesisSearch search(options_, reasoner_->memory(), verify, view_of);
    if (result.proposed) reasoner_->Verify(percepts.back().view, combined.belief, search, result);
    reasoner_->VerifyAgain(search, result);
    cached_ms = MillisecondsSince(begin);
  }
  reasoner_->Finish(result);
  return result;
}

void Row::Take(std::int64_t image, const std::vector<Percept>& percepts, PairCache& pairs) {
  const auto begin = std::chrono::steady_clock::now();
  double verify_ms = 0, cached_ms = 0;
  const LoopResult result = Detect(image, percepts, pairs, verify_ms, cached_ms);
  PlantLinks(image);
  ms_.push_back(MillisecondsSince(begin) - cached_ms + verify_ms + percepts.back().ms);
  observations_.push_back(Observe(result));
  if (result.late && result.late->query < image)
    TakeLate(*result.late, &observations_[static_cast<std::size_t>(result.late->query)]);
}

// Links between places that have nothing to do with each other, spread over the run.
void Row::PlantLinks(std::int64_t image) {
  if (parts_.false_links == 0 || image < 20) return;
  const int every = std::max(1, images_ / parts_.false_links);
  if (image % every != 0) return;
  std::mt19937_64 random(static_cast<std::uint64_t>(image) * 104729u + 3u);
  const std::int64_t a = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(image - 10));
  const std::int64_t b = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(image - 10));
  if (a != b) reasoner_->CloseLoop(std::max(a, b), std::min(a, b));
}

Json FiguresOf(const std::vector<LoopObservation>& observations, const LoopGroundTruth& truth,
               double propose_threshold) {
  const LoopEvaluation verified = EvaluateVerified(observations, truth);
  const LoopEvaluation posterior = EvaluatePosterior(observations, truth, propose_threshold);
  Json json = {{"r100", verified.recall_at_100_precision},
               {"r100_posterior", posterior.recall_at_100_precision},
               {"true", verified.true_positives},
               {"false", verified.false_positives},
               {"near", verified.ignored},
               {"rows_with_loop", verified.rows_with_loop},
               {"images", verified.images},
               {"f1", verified.f1_at_default},
               {"outcomes", Letters(verified.outcomes, truth, observations)}};
  if (!truth.best_views.empty()) {
    json["overlap"] = RecallParts(verified.recall_by_overlap);
    json["angle"] = RecallParts(verified.recall_by_angle);
  }
  json["reliability"] = Json::array();
  for (const ReliabilityBin& bin : verified.reliability)
    json["reliability"].push_back({bin.images, bin.mean_probability, bin.accuracy});
  json["false_loops"] = Json::array();
  for (const LoopObservation& o : observations) {
    if (o.accepted && truth.At(o.image, o.verified) == LoopLabel::kNone)
      json["false_loops"].push_back({o.image, o.verified, o.probability});
  }
  return json;
}

Json Row::Figures(const LoopGroundTruth& truth) const {
  std::vector<double> ms = ms_;
  std::sort(ms.begin(), ms.end());
  Json json = FiguresOf(observations_, truth, options_.propose_threshold);
  json["ms_median"] = ms.empty() ? 0.0 : ms[ms.size() / 2];
  return json;
}

}  // namespace tutti::bench
