// Options of the loop-closure detector. Every default is the one that the figures in docs/results were
// measured with.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tutti/core/options.h"

#pragma GCC visibility push(default)
namespace tutti {

/// How the members become one (docs/loop-closure.md section 4).
enum class CombinationRule {
  kJoint,     ///< one filter on the members' counts, each by what it is worth
  kMean,      ///< a filter each, the mean of their posteriors: the paper's
  kLogPool,   ///< a filter each, the geometric mean of their posteriors (logarithmic opinion pool)
  kProduct,   ///< a filter each, the product of their posteriors
  kMajority,  ///< a filter each, two of them must agree
  kNaive,     ///< one filter on the words of all members as if they were one kind
  kSingle     ///< one member alone
};

/// What a place's score says (docs/loop-closure.md section 2).
enum class EvidenceKind {
  kCounts,        ///< counts of matched words against the level that wrong places reach
  kStandardised,  ///< how far it stands out among the places of this image, in standard deviations: Labbe &
                  ///< Michaud 2013
};

/// How a signature is compared with a location (loop-closure.md section 2).
enum class LikelihoodKind { kSimilarity, kTfIdf };

/// Whose locations they are (loop-closure.md section 6).
enum class MemoryKind {
  kShared,     ///< one memory for all members: a location is a candidate of every member, or of none
  kPerMember,  ///< as the paper has it: each member rehearses, transfers and retrieves on its own
};

/// Who searches the words of float descriptors (descriptor_index.h).
enum class FloatIndex {
  kForest,  ///< kd-trees of our own, by FLANN's rules
  kFlann,   ///< FLANN's: much the same answers in 3 to 4 times the time (docs/loop-closure.md, section 3)
};

/// Words of the YAML files; kSingle has none, since it is called by its member's name.
EnumWords<CombinationRule> WordsOf(CombinationRule);
EnumWords<EvidenceKind> WordsOf(EvidenceKind);      ///< Words of the YAML files.
EnumWords<LikelihoodKind> WordsOf(LikelihoodKind);  ///< Words of the YAML files.
EnumWords<MemoryKind> WordsOf(MemoryKind);          ///< Words of the YAML files.
EnumWords<FloatIndex> WordsOf(FloatIndex);          ///< Words of the YAML files.

/// Names of members.
using MemberNames = std::vector<std::string>;
/// A number for each channel of a colour image.
using ChannelValues = std::array<double, 3>;

/// Options of the features that each member takes from an image.
struct ExtractionOptions {
  TUTTI_OPTION(int, features, 400, "strongest features kept per member and image, spread over the image",
               Basic(), From(1), To(10000));
  TUTTI_OPTION(int, max_pixels, 1 << 19,
               "images with more pixels are scaled down before anything else, so that no camera costs more "
               "than this",
               Unit("px"), From(1 << 12));
  TUTTI_OPTIONS_END;
};

/// Options of the likelihood of places (docs/loop-closure.md section 2).
struct EvidenceOptions {
  TUTTI_OPTION(EvidenceKind, kind, EvidenceKind::kCounts,
               "likelihood of a place: shared words against what wrong places share (counts), or "
               "standardised (2013); the next five are of counts");
  TUTTI_OPTION(double, sharpness, 2.0,
               "exponent (beta) of a place's count over the alias level, the count that wrong places reach",
               Above(0), To(10));
  TUTTI_OPTION(double, alias_share, 0.7,
               "share of the alias level that a place must reach to be more likely than a new one", Above(0),
               To(3));
  TUTTI_OPTION(double, floor, -1.0, "least logarithm of a likelihood", From(-10), Below(0));
  TUTTI_OPTION(double, attraction, 0.9,
               "how much more a place must show that many images resemble: exponent of its mean count; 0: "
               "no more",
               From(0), To(2));
  TUTTI_OPTION(double, persistence, 4.0,
               "how much less successive images say, which show the same, where wrong places stay alike for "
               "several images; 0: each says all that it shows",
               From(0), To(10));
  TUTTI_OPTIONS_END;
};

/// Options of one member's incremental vocabulary (loop-closure.md section 3).
struct VocabularyOptions {
  TUTTI_OPTION(double, nndr, 0.8,
               "a descriptor is an old word if d1 <= nndr * d2; on TRUE distance, not on its square",
               Above(0), To(1));
  TUTTI_OPTION(FloatIndex, float_index, FloatIndex::kForest,
               "for float descriptors: forest (ours) or flann (slower, for comparison)");
  TUTTI_OPTIONS_END;
};

/// Options of the geometric verification (loop-closure.md section 5).
struct VerificationOptions {
  TUTTI_OPTION(bool, enabled, true, "false: every proposal is accepted as it is, without a constraint",
               Basic());
  TUTTI_OPTION(int, max_hypotheses, 3, "separate places tried, best posterior first", From(1));
  TUTTI_OPTION(int, neighbours, 1, "graph levels around each place that are tried as well; 0: none", From(0),
               To(16));
  TUTTI_OPTION(double, match_ratio, 0.8, "Lowe's ratio test, on true distance", Above(0), To(1));
  TUTTI_OPTION(
      int, min_place_inliers, 12,
      "matches that fit one motion, before two images may show one place: the probability weighs them",
      From(8));
  TUTTI_OPTION(int, min_inliers, 30, "PnP: fewer inliers than this give no constraint", Basic(), From(8));
  TUTTI_OPTION(double, min_inlier_ratio, 0.3, "PnP: inliers / matches with a 3D point", From(0), To(1));
  TUTTI_OPTION(int, min_epipolar_inliers, 30,
               "essential, fundamental matrix: a match is held to a line only, so more are needed", From(8));
  TUTTI_OPTION(double, min_epipolar_ratio, 0,
               "and this share of all matches; 0: the probability alone weighs it", From(0), To(1));
  TUTTI_OPTION(double, min_spread, 0.045,
               "standard deviation of the inliers' pixels, as a share of width and height, along their "
               "narrowest direction; evenly spread: 0.29, on one line: 0. Inliers in abundance (beyond 1.5 "
               "times the least) may lie closer, down to 0.6 of it",
               From(0), Below(1));
  TUTTI_OPTION(double, reprojection_px, 2.5, "RANSAC threshold of PnP, Sim(3)", Unit("px"), Above(0));
  TUTTI_OPTION(double, epipolar_px, 1.5, "RANSAC threshold of the essential and fundamental matrix",
               Unit("px"), Above(0));
  TUTTI_OPTION(double, homography_px, 2.5, "RANSAC threshold of the homography; 0: none is sought",
               Unit("px"), From(0));
  TUTTI_OPTION(double, static_px, 1.5,
               "matches nearer than this to their own pixel did not move: if they are most of the inliers "
               "and in a part of the image only, the others must do; 0: off",
               Unit("px"), From(0));
  TUTTI_OPTION(double, min_depth_m, 0.1, "nearer depths count as unknown", Unit("m"), From(0));
  TUTTI_OPTION(double, max_depth_m, 80.0, "farther depths count as unknown", Unit("m"), Above(0));
  TUTTI_OPTIONS_END;
};

/// Options of the member `dnn`: a network of the caller's that describes an image as a whole (loop-closure.md
/// section 3). It gets one image of 3 channels, its first output is the descriptor. The names are those of
/// cv::dnn::blobFromImage; the defaults what nearly every network expects that was trained on ImageNet.
struct DnnOptions {
  TUTTI_OPTION(std::string, model, "",
               "ONNX file of a network that describes a whole image; required where members holds dnn",
               Basic());
  TUTTI_OPTION(int, width, 320, "of the image that the network gets; ours are scaled to it", Basic(),
               Unit("px"), From(16), To(4096));
  TUTTI_OPTION(int, height, 240, "of the image that the network gets", Basic(), Unit("px"), From(16),
               To(4096));
  TUTTI_OPTION(ChannelValues, mean, ChannelValues({123.675, 116.28, 103.53}),
               "subtracted from each channel, in the order that the network has them",
               Unit("grey levels of 255"), From(-1000), To(1000));
  TUTTI_OPTION(double, scale, 1.0 / 255.0, "and then each is multiplied by this", Above(0), To(1000));
  TUTTI_OPTION(ChannelValues, stddev, ChannelValues({0.229, 0.224, 0.225}), "and divided by this", Above(0),
               To(1000));
  TUTTI_OPTION(bool, swap_rb, true,
               "the network takes red, green, blue; false: blue, green, red, as OpenCV has them");
  TUTTI_OPTION(std::string, layer, "",
               "whose output is the descriptor, as the ONNX file names it; empty: the network's only output");
  TUTTI_OPTIONS_END;
};

/// Options of LoopDetector: section `loops:` of the YAML files.
struct LoopDetectorOptions {
  TUTTI_OPTION(CombinationRule, rule, CombinationRule::kJoint,
               "how the members are combined, or one member's name for that alone", Basic());
  TUTTI_OPTION(MemberNames, members, MemberNames({"surf", "sift", "orb"}),
               "members of the ensemble: surf, sift, orb, akaze, brisk, kaze, hog, dnn, and "
               "external_members",
               Basic());
  TUTTI_OPTION(MemberNames, external_members, {},
               "further names that members may hold: the caller extracts their features himself and gives "
               "them with each LoopQuery",
               CodeOnly());
  TUTTI_OPTION(MemberNames, dense_members, {},
               "of external_members, those that describe an image as a whole: no keypoints, and one row of "
               "CV_32F",
               CodeOnly());
  TUTTI_OPTION(LikelihoodKind, likelihood, LikelihoodKind::kTfIdf, "score of standardised evidence");
  TUTTI_OPTION(double, loop_threshold, 0.985, "accept a loop of this probability", Basic(), From(0), To(1));
  TUTTI_OPTION(double, propose_threshold, 0.08, "go to verification at H >= this", From(0), To(1));
  TUTTI_OPTION(double, link_threshold, 0.9, "a loop of this probability links its two places for the filter",
               From(0), To(1));
  TUTTI_OPTION(double, hypothesis_ratio, 0.0,
               "and at H >= this x the H of the image before; 0: whatever it was (0.9 in Labbe & Michaud "
               "2013)",
               From(0), To(1));
  TUTTI_OPTION(int, stm_size, 10, "locations in short-term memory, no candidates", From(1));
  TUTTI_OPTION(int, threads, 2, "most threads that the detector uses at once", From(1));
  TUTTI_OPTION(std::uint64_t, seed, 1, "of kd-forests and RANSAC");
  TUTTI_OPTION(double, bad_signature_ratio, 0.2,
               "a member abstains below this share of its mean number of features", From(0), To(1));
  TUTTI_OPTION(bool, ignore_bad_signatures, false,
               "an image that is bad for every member is no location at all");
  TUTTI_OPTION(bool, rehearsal, false, "merge a location into its predecessor when they look the same");
  TUTTI_OPTION(double, rehearsal_similarity, 0.6, "similarity from which on they do", Above(0), To(1));
  TUTTI_OPTION(MemoryKind, memory, MemoryKind::kShared,
               "one memory for all members, or one each, as in the paper");
  TUTTI_OPTION(int, wm_limit, 10000,
               "most locations in working memory, others go to long-term memory; 0: no limit", Basic(),
               From(0));
  TUTTI_OPTION(double, time_budget_ms, 0,
               "transfer locations as well while an image takes longer than this; 0: off. What is "
               "transferred then depends on the machine: results are not reproducible",
               Unit("ms"), From(0));
  TUTTI_OPTION(int, retrieval, 2,
               "locations brought back from long-term memory per image, near the hypothesis", From(0),
               To(100));
  TUTTI_OPTION(double, recent_share, 0.2, "share of working memory, the newest, that is never transferred",
               From(0), Below(1));
  TUTTI_OPTION(std::string, ltm_file, "",
               "SQLite file of the long-term memory; all that the detector learns is stored in it, and a "
               "later one with the same file goes on from there; empty: a temporary one",
               Basic());
  TUTTI_OPTION(bool, keep_posterior, false,
               "keep every posterior: LoopResult::posterior_by_location (costs O(locations) per image)");
  TUTTI_OPTION(bool, keep_evidence, false,
               "keep every score and posterior: LoopResult::posterior_by_location and "
               "MemberOpinion::evidence (costs O(locations x members) per image)");
  TUTTI_OPTION(ExtractionOptions, extraction, {}, "features");
  TUTTI_OPTION(EvidenceOptions, evidence, {}, "likelihood of a place");
  TUTTI_OPTION(VocabularyOptions, vocabulary, {}, "words");
  TUTTI_OPTION(VerificationOptions, verification, {}, "geometry");
  TUTTI_OPTION(DnnOptions, dnn, {}, "of the member dnn, off by default");
  TUTTI_OPTIONS_END;

  /// Empty if usable, else what is wrong and what to do.
  std::string Validate() const;
};

/// A published set of parameters (loop-closure.md section 9) on top of `options`: "paper-2013" (Labbe &
/// Michaud 2013), "rtabmap-0.8.3" (the reference system of the ensemble's paper), "standardised-mean" (the
/// ensemble's paper: standardised evidence, mean of the posteriors, every loop that geometry accepts), or
/// "default" (ours). Features (but their number) and verification (but min_epipolar_ratio) stay as they are.
/// Throws InputError that names the nearest word.
void ApplyPreset(const std::string& name, LoopDetectorOptions& options);

/// Names that ApplyPreset takes.
const std::vector<std::string>& KnownPresets();

/// The one configuration key: "joint", "mean", "log-pool", "product", "majority" or "naive" over
/// options.members, or a member's name ("surf", "sift", "orb", "akaze", "brisk") for that member alone.
/// Throws InputError that names the nearest word.
void SetRule(const std::string& word, LoopDetectorOptions& options);

/// The word that SetRule takes for these options.
std::string RuleName(const LoopDetectorOptions& options);

/// Names that options.members may hold without further ado: those of KnownFeatureTypes() and of
/// KnownDenseMembers().
std::vector<std::string> KnownMembers();

/// Members with keypoints: surf, sift, orb, akaze, brisk, kaze, and what RegisterFeatureType added.
std::vector<std::string> KnownFeatureTypes();

/// Members that describe an image as a whole (dense_model.h): hog, dnn.
std::vector<std::string> KnownDenseMembers();

}  // namespace tutti
#pragma GCC visibility pop
