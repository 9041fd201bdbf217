#include "tutti/loopclosure/detector_options.h"

#include <algorithm>
#include <cmath>

#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/loopclosure/features.h"

namespace tutti {
namespace {

const std::vector<std::string>& RuleWords() {
  static const std::vector<std::string> words = {"joint", "mean", "log-pool", "product", "majority", "naive"};
  return words;
}

std::string JoinWords(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

bool Holds(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::string OutOf(const char* name, const char* range) { return std::string(name) + " must be " + range; }

}  // namespace

std::string ExtractionOptions::Validate() const {
  if (features < 1 || features > 10000) return OutOf("extraction.features", "1 to 10000");
  if (grid_columns < 1 || grid_columns > 64) return OutOf("extraction.grid_columns", "1 to 64");
  if (max_pixels < 1 << 12) return OutOf("extraction.max_pixels", "at least 4096");
  if (min_pixels < 0) return OutOf("extraction.min_pixels", "0 (never enlarged) or more");
  if (surf_octaves < 1 || surf_octaves > 8) return OutOf("extraction.surf_octaves", "1 to 8");
  if (!(surf_threshold >= 0)) return OutOf("extraction.surf_threshold", "0 or more");
  if (!(surf_min_threshold >= 0)) return OutOf("extraction.surf_min_threshold", "0 or more");
  if (sift_max_pixels < 1 << 12) return OutOf("extraction.sift_max_pixels", "at least 4096");
  if (!(sift_contrast > 0)) return OutOf("extraction.sift_contrast", "above 0");
  if (!(sift_min_contrast > 0)) return OutOf("extraction.sift_min_contrast", "above 0");
  if (orb_fast_threshold < 1 || orb_fast_threshold > 255)
    return OutOf("extraction.orb_fast_threshold", "1 to 255");
  if (!(orb_border > 0 && orb_border <= 1)) return OutOf("extraction.orb_border", "above 0, at most 1");
  return {};
}

std::string VocabularyOptions::Validate() const {
  if (!(nndr > 0 && nndr <= 1))
    return OutOf("vocabulary.nndr", "above 0 and at most 1 (a ratio of true distances)");
  if (trees < 1 || trees > 32) return OutOf("vocabulary.trees", "1 to 32");
  if (checks < 1) return OutOf("vocabulary.checks", "at least 1");
  if (hash_tables < 1 || hash_tables > 64) return OutOf("vocabulary.hash_tables", "1 to 64");
  return {};
}

std::string EvidenceOptions::Validate() const {
  if (!(sharpness > 0 && sharpness <= 10)) return OutOf("evidence.sharpness", "above 0, at most 10");
  if (!(alias_share > 0 && alias_share <= 3)) return OutOf("evidence.alias_share", "above 0, at most 3");
  if (!(floor < 0 && floor >= -10)) return OutOf("evidence.floor", "below 0, at least -10");
  if (!(attraction >= 0 && attraction <= 2)) return OutOf("evidence.attraction", "0 to 2");
  if (!(persistence >= 0 && persistence <= 10)) return OutOf("evidence.persistence", "0 to 10");
  return {};
}

std::string VerificationOptions::Validate() const {
  if (max_hypotheses < 1) return OutOf("verification.max_hypotheses", "at least 1");
  if (neighbours < 0 || neighbours > 16) return OutOf("verification.neighbours", "0 to 16");
  if (!(nearer_share > 0 && nearer_share <= 1))
    return OutOf("verification.nearer_share", "above 0, at most 1");
  if (!(match_ratio > 0 && match_ratio <= 1))
    return OutOf("verification.match_ratio", "above 0 and at most 1");
  if (min_inliers < 8) return OutOf("verification.min_inliers", "at least 8");
  if (!(min_inlier_ratio >= 0 && min_inlier_ratio <= 1))
    return OutOf("verification.min_inlier_ratio", "0 to 1");
  if (min_epipolar_inliers < 8) return OutOf("verification.min_epipolar_inliers", "at least 8");
  if (!(min_epipolar_ratio >= 0 && min_epipolar_ratio <= 1))
    return OutOf("verification.min_epipolar_ratio", "0 to 1");
  if (!(min_spread >= 0 && min_spread < 1)) return OutOf("verification.min_spread", "0 to 1");
  if (!(reprojection_px > 0)) return OutOf("verification.reprojection_px", "above 0");
  if (!(epipolar_px > 0)) return OutOf("verification.epipolar_px", "above 0");
  if (!(homography_px >= 0)) return OutOf("verification.homography_px", "0 (off) or more");
  if (!(homography_share > 0 && homography_share <= 1))
    return OutOf("verification.homography_share", "above 0, at most 1");
  if (!(camera_share >= 0 && camera_share <= 1)) return OutOf("verification.camera_share", "0 to 1");
  if (!(static_px >= 0)) return OutOf("verification.static_px", "0 (off) or more");
  if (!(confidence > 0 && confidence < 1)) return OutOf("verification.confidence", "between 0 and 1");
  if (max_iterations < 1) return OutOf("verification.max_iterations", "at least 1");
  if (!(pixel_sigma > 0)) return OutOf("verification.pixel_sigma", "above 0");
  if (!(min_depth_m >= 0 && max_depth_m > min_depth_m)) {
    return "verification.min_depth_m must be at least 0 and below verification.max_depth_m";
  }
  return {};
}

std::string DnnOptions::Validate() const {
  constexpr int kLeastSide = 16, kMostSide = 4096;  // [px]
  constexpr double kMost = 1000;
  const auto usable = [](double factor) { return factor > 0 && factor <= kMost; };
  if (width < kLeastSide || width > kMostSide) return OutOf("dnn.width", "16 to 4096");
  if (height < kLeastSide || height > kMostSide) return OutOf("dnn.height", "16 to 4096");
  if (!std::all_of(mean.begin(), mean.end(), [](double level) { return std::abs(level) <= kMost; }))
    return OutOf("dnn.mean", "-1000 to 1000 for each channel");
  if (!usable(scale)) return OutOf("dnn.scale", "above 0, at most 1000");
  if (!std::all_of(stddev.begin(), stddev.end(), usable))
    return OutOf("dnn.stddev", "above 0, at most 1000 for each channel");
  return {};
}

std::string LoopDetectorOptions::Validate() const {
  std::vector<std::string> known = KnownMembers();
  known.insert(known.end(), external_members.begin(), external_members.end());
  if (members.empty()) return "members must name at least one of " + JoinWords(KnownMembers());
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (!Holds(known, members[i])) {
      return "members holds '" + members[i] + "', which is not known; did you mean '" +
             NearestWord(members[i], known) + "'?";
    }
    if (Holds({members.begin(), members.begin() + static_cast<std::ptrdiff_t>(i)}, members[i])) {
      return "members holds '" + members[i] + "' twice; name each member once";
    }
  }
  for (const std::string& name : dense_members) {
    if (!Holds(external_members, name)) {
      return "dense_members holds '" + name + "', which is not in external_members; name it there, too";
    }
  }
  if (Holds(members, "dnn") && !Holds(external_members, "dnn") && dnn.model.empty()) {
    return "members holds 'dnn', but dnn.model is empty; give the ONNX file of a network "
           "(docs/loop-closure.md section 3 says which fit), or leave 'dnn' out";
  }
  for (const std::string& name : members) {
    const bool dense = Holds(KnownDenseMembers(), name) || Holds(dense_members, name);
    if (dense && rule == CombinationRule::kNaive) {
      return "the rule 'naive' puts the words of all members together, and '" + name +
             "' has none; leave it out or choose another rule";
    }
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
  if (!(loop_threshold >= 0 && loop_threshold <= 1)) return OutOf("loop_threshold", "0 to 1");
  if (!(propose_threshold >= 0 && propose_threshold <= 1)) return OutOf("propose_threshold", "0 to 1");
  if (!(link_threshold >= 0 && link_threshold <= 1)) return OutOf("link_threshold", "0 to 1");
  if (stm_size < 1) return OutOf("stm_size", "at least 1");
  if (threads < 1) return OutOf("threads", "at least 1");
  if (!(bad_signature_ratio >= 0 && bad_signature_ratio <= 1)) return OutOf("bad_signature_ratio", "0 to 1");
  if (!(virtual_place_prior > 0 && virtual_place_prior < 1))
    return OutOf("virtual_place_prior", "between 0 and 1");
  if (!(hypothesis_ratio >= 0 && hypothesis_ratio <= 1)) return OutOf("hypothesis_ratio", "0 to 1");
  if (island_levels < 0 || island_levels > 16) return OutOf("island_levels", "0 to 16");
  if (consistent_images < 0) return OutOf("consistent_images", "0 or more");
  if (wm_limit < 0) return OutOf("wm_limit", "0 (no limit) or more");
  if (!(time_budget_ms >= 0)) return OutOf("time_budget_ms", "0 (off) or more");
  if (retrieval < 0 || retrieval > 100) return OutOf("retrieval", "0 to 100");
  if (!(recent_share >= 0 && recent_share < 1)) return OutOf("recent_share", "0 or more, below 1");
  if (!(rehearsal_similarity > 0 && rehearsal_similarity <= 1))
    return OutOf("rehearsal_similarity", "above 0, at most 1");
  for (const std::string& problem : {extraction.Validate(), vocabulary.Validate(), evidence.Validate(),
                                     verification.Validate(), dnn.Validate()}) {
    if (!problem.empty()) return problem;
  }
  return {};
}

std::vector<std::string> KnownDenseMembers() { return {"hog", "dnn"}; }

std::vector<std::string> KnownMembers() {
  std::vector<std::string> names = KnownFeatureTypes();
  const std::vector<std::string> dense = KnownDenseMembers();
  names.insert(names.end(), dense.begin(), dense.end());
  return names;
}

std::vector<std::string> KnownFeatureTypes() {
  std::vector<std::string> names = {"surf", "sift", "orb", "akaze", "brisk", "kaze", "gftt"};
  const std::vector<std::string> registered = RegisteredFeatureTypes();
  names.insert(names.end(), registered.begin(), registered.end());
  return names;
}

void SetRule(const std::string& word, LoopDetectorOptions& options) {
  const auto rule = std::find(RuleWords().begin(), RuleWords().end(), word);
  if (rule != RuleWords().end()) {
    constexpr CombinationRule kRules[] = {CombinationRule::kJoint,    CombinationRule::kMean,
                                          CombinationRule::kLogPool,  CombinationRule::kProduct,
                                          CombinationRule::kMajority, CombinationRule::kNaive};
    options.rule = kRules[rule - RuleWords().begin()];
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
                   "'? Known: " + JoinWords(RuleWords()) + ", or one member: " + JoinWords(known));
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
                     "'? Known: " + JoinWords(KnownPresets()));
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
  switch (options.rule) {
    case CombinationRule::kJoint:
      return "joint";
    case CombinationRule::kMean:
      return "mean";
    case CombinationRule::kLogPool:
      return "log-pool";
    case CombinationRule::kProduct:
      return "product";
    case CombinationRule::kMajority:
      return "majority";
    case CombinationRule::kNaive:
      return "naive";
    case CombinationRule::kSingle:
      break;
  }
  return options.members.empty() ? "single" : options.members.front();
}

}  // namespace tutti
