#include "tutti/loopclosure/detector_options.h"

#include <algorithm>

#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

std::vector<std::string> RuleWords() {
  std::vector<std::string> words;
  for (const auto& [word, rule] : WordsOf(CombinationRule())) words.emplace_back(word);
  return words;
}

bool Holds(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

EnumWords<CombinationRule> WordsOf(CombinationRule /*of*/) {
  return {{"joint", CombinationRule::kJoint},       {"mean", CombinationRule::kMean},
          {"log-pool", CombinationRule::kLogPool},  {"product", CombinationRule::kProduct},
          {"majority", CombinationRule::kMajority}, {"naive", CombinationRule::kNaive}};
}
EnumWords<EvidenceKind> WordsOf(EvidenceKind /*of*/) {
  return {{"counts", EvidenceKind::kCounts}, {"standardised", EvidenceKind::kStandardised}};
}
EnumWords<LikelihoodKind> WordsOf(LikelihoodKind /*of*/) {
  return {{"similarity", LikelihoodKind::kSimilarity}, {"tfidf", LikelihoodKind::kTfIdf}};
}
EnumWords<MemoryKind> WordsOf(MemoryKind /*of*/) {
  return {{"shared", MemoryKind::kShared}, {"per_member", MemoryKind::kPerMember}};
}
EnumWords<FloatIndex> WordsOf(FloatIndex /*of*/) {
  return {{"forest", FloatIndex::kForest}, {"flann", FloatIndex::kFlann}};
}

namespace {

// Empty, or what is wrong with the members' names.
std::string MembersProblem(const LoopDetectorOptions& o) {
  std::vector<std::string> known = KnownMembers();
  known.insert(known.end(), o.external_members.begin(), o.external_members.end());
  if (o.members.empty()) return "members must name at least one of " + JoinText(KnownMembers());
  for (std::size_t i = 0; i < o.members.size(); ++i) {
    if (!Holds(known, o.members[i])) {
      return "members holds '" + o.members[i] + "', which is not known; did you mean '" +
             NearestWord(o.members[i], known) + "'?";
    }
    if (Holds({o.members.begin(), o.members.begin() + static_cast<std::ptrdiff_t>(i)}, o.members[i])) {
      return "members holds '" + o.members[i] + "' twice; name each member once";
    }
  }
  for (const std::string& name : o.dense_members) {
    if (!Holds(o.external_members, name)) {
      return "dense_members holds '" + name + "', which is not in external_members; name it there, too";
    }
  }
  if (Holds(o.members, "dnn") && !Holds(o.external_members, "dnn") && o.dnn.model.empty()) {
    return "members holds 'dnn', but dnn.model is empty; give the ONNX file of a network "
           "(docs/networks.md says which fit), or leave 'dnn' out";
  }
  for (const std::string& name : o.members) {
    const bool dense = Holds(KnownDenseMembers(), name) || Holds(o.dense_members, name);
    if (dense && o.rule == CombinationRule::kNaive) {
      return "the rule 'naive' puts the words of all members together, and '" + name +
             "' has none; leave it out or choose another rule";
    }
  }
  return "";
}

}  // namespace

std::string LoopDetectorOptions::Validate() const {
  for (const std::string& problem : {OutOfRange(*this), MembersProblem(*this)}) {
    if (!problem.empty()) return problem;
  }
  if (rule == CombinationRule::kSingle && members.size() != 1) {
    return "the rule 'single' takes exactly one member, not " + std::to_string(members.size());
  }
  if (rule == CombinationRule::kJoint && memory == MemoryKind::kPerMember) {
    return "the rule 'joint' needs memory: shared (its one filter works on the locations of all members)";
  }
  if (rule == CombinationRule::kJoint && evidence.kind == EvidenceKind::kStandardised) {
    return "the rule 'joint' needs evidence.kind: counts (standardised scores can't be added up)";
  }
  if (verification.max_depth_m <= verification.min_depth_m) {
    return "verification.min_depth_m must be below verification.max_depth_m";
  }
  return "";
}

std::vector<std::string> KnownDenseMembers() { return {"hog", "dnn"}; }

std::vector<std::string> KnownMembers() {
  std::vector<std::string> names = KnownFeatureTypes();
  const std::vector<std::string> dense = KnownDenseMembers();
  names.insert(names.end(), dense.begin(), dense.end());
  return names;
}

void SetRule(const std::string& word, LoopDetectorOptions& options) {
  for (const auto& [known_word, rule] : WordsOf(CombinationRule())) {
    if (word != known_word) continue;
    options.rule = rule;
    return;
  }
  const std::vector<std::string> known = KnownMembers();
  if (Holds(known, word)) {
    options.rule = CombinationRule::kSingle;
    options.members = {word};
    return;
  }
  std::vector<std::string> all = RuleWords();
  all.insert(all.end(), known.begin(), known.end());
  throw InputError("unknown rule '" + word + "'; did you mean '" + NearestWord(word, all) +
                   "'? Known: " + JoinText(RuleWords()) + ", or one member: " + JoinText(known));
}

const std::vector<std::string>& KnownPresets() {
  static const std::vector<std::string> names = {"default", "standardised-mean", "paper-2013",
                                                 "rtabmap-0.8.3"};
  return names;
}

namespace {

// Our defaults with a published set in their place.
LoopDetectorOptions Published(const std::string& name) {
  LoopDetectorOptions preset;
  if (name == "default") return preset;
  preset.rule = CombinationRule::kMean;
  preset.evidence.kind = EvidenceKind::kStandardised;
  preset.loop_threshold = 0.0;  // what geometry accepts is a loop
  preset.link_threshold = 0.0;
  preset.propose_threshold = 0.07;
  preset.verification.min_epipolar_ratio = 0.55;
  preset.verification.min_place_inliers = 30;
  if (name == "standardised-mean") return preset;
  preset.propose_threshold = 0.11;  // swept in the 2013 paper; this is its system's own
  preset.recent_share = 0.2;
  preset.extraction.features = 400;
  preset.vocabulary.nndr = 0.8;
  preset.rehearsal = true;
  if (name == "paper-2013") {
    preset.hypothesis_ratio = 0.9;
    preset.likelihood = LikelihoodKind::kSimilarity;
    preset.stm_size = 30;
    preset.rehearsal_similarity = 0.20;
    preset.bad_signature_ratio = 0.25;
    preset.ignore_bad_signatures = true;
    preset.wm_limit = 300;
  } else if (name == "rtabmap-0.8.3") {
    preset.hypothesis_ratio = 0.0;
    preset.likelihood = LikelihoodKind::kTfIdf;
    preset.stm_size = 10;
    preset.rehearsal_similarity = 0.6;
    preset.bad_signature_ratio = 0.2;
    preset.ignore_bad_signatures = false;
    preset.wm_limit = 0;
  } else {
    throw InputError("unknown preset '" + name + "'; did you mean '" + NearestWord(name, KnownPresets()) +
                     "'? Known: " + JoinText(KnownPresets()));
  }
  return preset;
}

}  // namespace

void ApplyPreset(const std::string& name, LoopDetectorOptions& options) {
  const LoopDetectorOptions preset = Published(name);
  // A rule that was chosen stays: presets are compared with every rule.
  if (options.rule == CombinationRule::kJoint || options.rule == CombinationRule::kMean) {
    options.rule = preset.rule;
  }
  options.evidence = preset.evidence;
  options.loop_threshold = preset.loop_threshold;
  options.propose_threshold = preset.propose_threshold;
  options.verification.min_epipolar_ratio = preset.verification.min_epipolar_ratio;
  options.verification.min_place_inliers = preset.verification.min_place_inliers;
  options.link_threshold = preset.link_threshold;
  options.hypothesis_ratio = preset.hypothesis_ratio;
  options.likelihood = preset.likelihood;
  options.stm_size = preset.stm_size;
  options.rehearsal = preset.rehearsal;
  options.rehearsal_similarity = preset.rehearsal_similarity;
  options.bad_signature_ratio = preset.bad_signature_ratio;
  options.ignore_bad_signatures = preset.ignore_bad_signatures;
  options.wm_limit = preset.wm_limit;
  options.recent_share = preset.recent_share;
  options.extraction.features = preset.extraction.features;
  options.vocabulary.nndr = preset.vocabulary.nndr;
}

std::string RuleName(const LoopDetectorOptions& options) {
  if (options.rule != CombinationRule::kSingle) return WordOf(options.rule);
  return options.members.empty() ? "single" : options.members.front();
}

}  // namespace tutti
