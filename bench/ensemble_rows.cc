// Every rule, every member and the seed's ensemble on one set of images, in one pass: features, words and
// verified pairs are the same for all rows, and made once. bench/ensemble_protocol runs it and writes the
// tables.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <sstream>

#include "apps/tutti/loops/joined_pairs.h"
#include "apps/tutti/loops/loops_input.h"
#include "data/synthetic/image_change.h"
#include "loopclosure/detector/parallel.h"
#include "loopclosure/filter/place_reasoner.h"
#include "loopclosure/memory/dense.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/evaluation.h"

namespace tutti {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string images, change, shuffle, twice;
  cli::GroundTruthArguments truth;
  std::uint64_t change_seed = 1;
  bool overlay = false;
  int sift_features = 0;  // 0: as many as the others
  int false_links = 0;
  std::vector<std::string> rows;
  std::vector<std::string> members = {"surf", "sift", "orb"};
  bool posterior_only = false;
  int threads = 2;
};

// Names under which a member's copy stands, for "one member twice".
std::string BaseName(const std::string& name) { return name.substr(0, name.find('\'')); }

// What all rows see of one image.
struct Percept {
  std::vector<SeenWords> words;  // by member
  View view;                     // of all members
  std::vector<View> own;         // of each member alone
  double ms = 0;
};

// The senses: extracts and quantises once for all rows.
class Perception {
 public:
  Perception(const std::vector<std::string>& names, const Arguments& arguments) : arguments_(arguments) {
    options_.threads = arguments.threads;
    for (std::size_t k = 0; k < names.size(); ++k) {
      LoopDetectorOptions options = options_;
      if (names[k] == "sift" && arguments.sift_features > 0)
        options.extraction.features = arguments.sift_features;
      members_.emplace_back(BaseName(names[k]), options, options.seed * 1000003u + k);
    }
  }

  Percept See(const LoopQuery& query) {
    const auto begin = std::chrono::steady_clock::now();
    const cv::Mat grey = ToGrey8(query.image);
    std::vector<Features> features(members_.size());
    Percept percept;
    percept.words.resize(members_.size());
    RunParallel(static_cast<int>(members_.size()), options_.threads, [&](int i) {
      const std::size_t k = static_cast<std::size_t>(i);
      Member& member = members_[k];
      features[k] = member.Extract(query.image, grey, query.mask);
      if (!member.Judge(features[k])) return;
      if (member.dense()) {
        percept.words[k].descriptor = NormalisedDescriptor(features[k].descriptors);
        return;
      }
      percept.words[k].words = member.vocabulary().Quantise(features[k].descriptors);
      for (const cv::KeyPoint& keypoint : features[k].keypoints) {
        percept.words[k].cells.push_back(SeenWords::Cell(keypoint.pt, query.image.size()));
      }
      member.vocabulary().AddReferences(Signature(percept.words[k].words));
    });
    percept.view = MakeView(query, features, options_.verification);
    for (const Features& own : features) percept.own.push_back(MakeView(query, {own}, options_.verification));
    percept.ms = Milliseconds(begin);
    return percept;
  }

  static double Milliseconds(std::chrono::steady_clock::time_point begin) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  }

 private:
  const Arguments& arguments_;
  LoopDetectorOptions options_;
  std::vector<Member> members_;
};

// Verified pairs that some row has asked for.
struct PairCache {
  explicit PairCache(const VerificationOptions& options) : verifier(options, 1) {}
  GeometricVerifier verifier;
  std::map<std::pair<std::int64_t, std::int64_t>, std::pair<Verification, double>> done;

  // The time is what it took, whoever asked first.
  Verification Verify(const View& query, const View& candidate, double& ms) {
    const auto key = std::make_pair(query.id, candidate.id);
    auto found = done.find(key);
    if (found == done.end()) {
      const auto begin = std::chrono::steady_clock::now();
      Verification verification = verifier.Verify(query, candidate, 1);
      const double took = Perception::Milliseconds(begin);
      found = done.emplace(key, std::make_pair(std::move(verification), took)).first;
    }
    ms += found->second.second;
    return found->second.first;
  }
};

// One row: a rule over some of the members.
class Row {
 public:
  Row(const std::string& name, const std::vector<std::string>& names, const Arguments& arguments)
      : name_(name), arguments_(arguments) {
    std::string rule = name;
    if (rule == "seed") {
      ApplyPreset("standardised-mean", options_);
      rule = "mean";
    }
    std::vector<std::string> chosen = names;
    if (const std::size_t colon = rule.find(':'); colon != std::string::npos) {
      chosen.clear();
      std::istringstream list(rule.substr(colon + 1));
      for (std::string member; std::getline(list, member, '+');) chosen.push_back(member);
      rule.resize(colon);
    }
    own_ = rule.size() > 4 && rule.compare(rule.size() - 4, 4, "/own") == 0;
    if (own_) rule.resize(rule.size() - 4);
    SetRule(rule, options_);
    options_.threads = 1;
    options_.wm_limit = 0;
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

  void Take(const LoopQuery& query, const std::vector<Percept>& percepts, PairCache& pooled,
            PairCache& alone) {
    const auto begin = std::chrono::steady_clock::now();
    const Percept& now = percepts.back();
    std::vector<SeenWords> words;
    for (const std::size_t k : members_) words.push_back(now.words[k]);
    LoopResult result;
    result.query = query.id;
    reasoner_->Remember(query.id, words);
    const CombinedBelief combined = reasoner_->Step(result, [&](std::size_t u, internal::FilterUnit& unit) {
      if (options_.members[u] == arguments_.shuffle) Shuffle(query.id, unit.counts);
    });
    double verify_ms = 0;
    result.proposed = reasoner_->Proposes(combined, result);
    double own_ms = Perception::Milliseconds(begin);
    if (result.proposed && !arguments_.posterior_only) {
      PairCache& cache = own_ ? alone : pooled;
      const auto view = [&](const Percept& p) -> const View& {
        return own_ ? p.own[members_.front()] : p.view;
      };
      reasoner_->Verify(
          view(now), combined.belief,
          [&](const View& a, const View& b, int) { return cache.Verify(a, b, verify_ms); },
          [&](int slot) -> const View& { return view(percepts[static_cast<std::size_t>(slot)]); }, result);
    }
    reasoner_->Finish(result);
    PlantLinks(query.id);
    own_ms += verify_ms + now.ms;
    ms_.push_back(own_ms);
    observations_.push_back(Observe(result));
  }

  Json Figures(const LoopGroundTruth& truth) const {
    const LoopEvaluation verified = EvaluateVerified(observations_, truth);
    const LoopEvaluation posterior = EvaluatePosterior(observations_, truth, options_.propose_threshold);
    std::vector<double> ms = ms_;
    std::sort(ms.begin(), ms.end());
    Json json = {{"r100", verified.recall_at_100_precision},
                 {"r100_posterior", posterior.recall_at_100_precision},
                 {"true", verified.true_positives},
                 {"false", verified.false_positives},
                 {"ignored", verified.ignored},
                 {"rows_with_loop", verified.rows_with_loop},
                 {"images", verified.images},
                 {"f1", verified.f1_at_default},
                 {"best_f1_posterior", posterior.best_f1},
                 {"area_posterior", posterior.area_under_curve},
                 {"ms_median", ms.empty() ? 0.0 : ms[ms.size() / 2]}};
    Json bins = Json::array();
    for (const ReliabilityBin& bin : verified.reliability) {
      bins.push_back({bin.images, bin.mean_probability, bin.accuracy});
    }
    json["reliability"] = bins;
    Json said = Json::array();
    for (const LoopObservation& o : observations_) {
      if (!o.accepted) continue;
      const LoopLabel label = truth.At(o.image, o.verified);
      said.push_back({o.image, o.verified, o.probability,
                      label == LoopLabel::kLoop   ? 1
                      : label == LoopLabel::kNone ? 0
                                                  : -1});
    }
    json["said"] = said;
    return json;
  }
  const std::string& name() const { return name_; }

 private:
  // A member that is broken: its counts are those of other places.
  void Shuffle(std::int64_t image, std::vector<double>& counts) const {
    std::mt19937_64 random(static_cast<std::uint64_t>(image) * 7919u + 17u);
    std::shuffle(counts.begin(), counts.end(), random);
  }

  // Links between places that have nothing to do with each other, spread over the run.
  void PlantLinks(std::int64_t image) {
    if (arguments_.false_links == 0 || image < 20) return;
    const int every = std::max(1, (arguments_.truth.stride > 0 ? total_ : 1) / arguments_.false_links);
    if (image % every != 0) return;
    std::mt19937_64 random(static_cast<std::uint64_t>(image) * 104729u + 3u);
    const std::int64_t a = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(image - 10));
    const std::int64_t b = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(image - 10));
    if (a != b) reasoner_->CloseLoop(std::max(a, b), std::min(a, b));
  }

 public:
  void SetTotal(int total) { total_ = total; }

 private:
  std::string name_;
  const Arguments& arguments_;
  LoopDetectorOptions options_;
  bool own_ = false;
  int total_ = 1;
  std::vector<std::size_t> members_;
  std::vector<Member> shells_;  // names for the reasoner; the words are made elsewhere
  std::unique_ptr<internal::PlaceReasoner> reasoner_;
  std::vector<LoopObservation> observations_;
  std::vector<double> ms_;
};

// A black rim, and at the bottom a part of the robot itself: the same in every image.
void Overlay(cv::Mat& image) {
  const int rim = std::max(2, image.rows / 25);
  const int part = image.rows / 6;
  cv::RNG random(7);
  for (int i = 0; i < 60; ++i) {
    const int height = random.uniform(4, 20), width = random.uniform(4, 30);
    const int y = image.rows - random.uniform(rim, part + rim), x = random.uniform(0, image.cols);
    const cv::Rect box(x, y, width, height);
    const int tone = random.uniform(0, 256);
    image(box & cv::Rect(0, image.rows - part, image.cols, part)) = cv::Scalar(tone, tone, tone, 255);
  }
  cv::rectangle(image, cv::Rect(0, 0, image.cols, image.rows), cv::Scalar::all(0), 2 * rim);
}

LoopQuery Read(const std::filesystem::path& left, const std::filesystem::path& right, int number,
               int change_from, const Arguments& arguments) {
  LoopQuery query;
  query.id = number;
  query.image = right.empty() ? cv::imread(left.string(), cv::IMREAD_UNCHANGED)
                              : cli::ReadJoined(left, right, &query.cameras);
  if (query.image.empty()) throw InputError(left.string() + ": can't be read");
  if (!arguments.change.empty() && number >= change_from) {
    query.image = ImageChange::Parse(arguments.change).Apply(query.image, arguments.change_seed, number);
  }
  if (arguments.overlay) Overlay(query.image);
  return query;
}

int Run(const Arguments& arguments) {
  const auto [images, rights, truth, recording, stride] =
      cli::LoadImageSet(arguments.images, arguments.truth);
  int change_from = 0;
  while (change_from < truth.size() && !truth.HasLoop(change_from)) ++change_from;

  std::vector<std::string> names = arguments.members;
  if (!arguments.twice.empty()) names.push_back(arguments.twice + "'");
  Perception perception(names, arguments);
  std::vector<Row> rows;
  rows.reserve(arguments.rows.size());
  for (const std::string& row : arguments.rows) {
    rows.emplace_back(row, names, arguments);
    rows.back().SetTotal(truth.size());
  }
  const LoopDetectorOptions defaults;
  PairCache pooled(defaults.verification);
  VerificationOptions scaled = defaults.verification;
  scaled.scale_bar = true;
  std::map<std::string, PairCache> alone;
  std::vector<Percept> percepts;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const LoopQuery query = Read(images[i], rights[i], static_cast<int>(i), change_from, arguments);
    percepts.push_back(perception.See(query));
    for (Row& row : rows) {
      row.Take(query, percepts, pooled, alone.try_emplace(row.name(), scaled).first->second);
    }
  }
  Json json;
  json["images"] = percepts.size();
  json["ground_truth"] = truth.description;
  json["rows"] = Json::object();
  for (const Row& row : rows) json["rows"][row.name()] = row.Figures(truth);
  std::printf("%s\n", json.dump().c_str());
  return 0;
}

}  // namespace
}  // namespace tutti

int main(int argc, char** argv) {
  CLI::App app("Every row of the ensemble's protocol on one set of images, as JSON");
  tutti::Arguments a;
  a.rows = {"joint", "mean", "log-pool", "product",  "majority", "naive", "surf",
            "sift",  "orb",  "surf/own", "sift/own", "orb/own",  "seed"};
  app.add_option("--images", a.images, "folder")->required();
  app.add_option("--ground-truth", a.truth.file, "loop matrix or trajectory")->required();
  app.add_option("--stride", a.truth.stride, "every n-th image");
  app.add_flag("--join-pairs", a.truth.join_pairs, "left and right images make one");
  app.add_option("--gt-distance", a.truth.rule.distance_m, "[m]");
  app.add_option("--gt-angle", a.truth.rule.angle_deg, "[deg]");
  app.add_option("--gt-ignore", a.truth.rule.ignore_m, "[m]");
  app.add_option("--gt-exclude-s", a.truth.rule.exclude_s, "[s]");
  app.add_option("--change", a.change, "changes every image from the first one whose row has a loop on");
  app.add_option("--change-seed", a.change_seed, "of the change");
  app.add_flag("--overlay", a.overlay, "a black rim and a part of the robot in every image");
  app.add_option("--shuffle", a.shuffle, "this member's counts are shuffled in every image");
  app.add_option("--twice", a.twice, "this member is there twice");
  app.add_option("--sift-features", a.sift_features, "SIFT finds no more");
  app.add_option("--false-links", a.false_links, "so many false links are planted");
  app.add_option("--rows", a.rows, "which; joint:surf+orb: the rule over these members alone")
      ->delimiter(',');
  app.add_option("--members", a.members, "of the ensemble")->delimiter(',');
  app.add_flag("--posterior-only", a.posterior_only, "no geometry, and no links that come of it");
  app.add_option("--threads", a.threads, "for extraction");
  CLI11_PARSE(app, argc, argv);
  try {
    return tutti::Run(a);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "ensemble_rows: %s\n", e.what());
    return 2;
  }
}
