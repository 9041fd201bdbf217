// Options of the loop-closure detector. Every default is the one that the results in bench/ were measured
// with.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

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
  kFlann,   ///< FLANN's: much the same answers, several times slower (docs/results/index.md)
};

/// Options of the features that each member takes from an image.
struct ExtractionOptions {
  int features = 400;           ///< strongest features kept per member and image, spread over the image
  int grid_columns = 8;         ///< cells over which they are spread, along the longer side; 1: no spreading
  int max_pixels = 1 << 19;     ///< images with more pixels are scaled down before anything else, so that
                                ///< no camera costs more than this [px]
  int min_pixels = 100000;      ///< SURF and SIFT see an image of fewer pixels at twice its size [px]
  int surf_octaves = 4;         ///< octaves of the Hessian pyramid (the paper's 4)
  double surf_threshold = 1.0;  ///< determinant of Hessian below which a SURF point is dropped (dlib's scale)
  double surf_min_threshold = 0.05;  ///< where fewer than `features` reach surf_threshold, weaker ones are
                                     ///< taken in order of strength, down to this determinant of Hessian
  int sift_max_pixels = 1 << 19;     ///< of SIFT's first octave: a larger image is scaled down to it [px]
  double sift_contrast = 0.02;       ///< contrast threshold of SIFT (OpenCV's own default is 0.04)
  double sift_min_contrast = 0.003;  ///< where fewer than `features` reach sift_contrast, weaker ones are
                                     ///< taken in order of strength, down to this contrast
  int orb_fast_threshold = 10;       ///< FAST threshold of ORB [grey levels of 255]
  double orb_border =
      0.05;                ///< no ORB point is nearer to the border than this share of the shorter side, but
                           ///< for 31 px (OpenCV's own default for images of any size), above 0, at most 1
  bool root_sift = false;  ///< SIFT compared by the Hellinger kernel (Arandjelovic & Zisserman, CVPR 2012)

  /// Empty if usable, else what is wrong and what to do.
  std::string Validate() const;
};

/// Options of one member's incremental vocabulary (loop-closure.md section 3).
struct VocabularyOptions {
  double nndr = 0.8;  ///< a descriptor is an old word if d1 <= nndr * d2; on TRUE distance, not on its square
  FloatIndex float_index = FloatIndex::kForest;  ///< for float descriptors
  int trees = 4;                                 ///< kd-trees of the index (float descriptors)
  int checks = 32;                               ///< leaves visited per search (float descriptors)
  int hash_tables = 5;                           ///< random tries of the Hamming index (binary descriptors)

  /// Empty if usable, else what is wrong and what to do.
  std::string Validate() const;
};

/// Options of the likelihood of places (docs/loop-closure.md section 2).
struct EvidenceOptions {
  EvidenceKind kind = EvidenceKind::kCounts;  ///< the next five are of kCounts
  double sharpness = 2.0;    ///< exponent of a count beyond the alias level: beta, above 0, at most 10
  double alias_share = 0.7;  ///< share of the alias level that a place must reach to be more likely than a
                             ///< new one, above 0, at most 3
  double floor = -1.0;       ///< least logarithm of a likelihood, below 0, at least -10
  double attraction = 0.9;   ///< how much more a place must show that many images resemble: exponent of its
                             ///< mean count, 0 (no more) to 2
  double persistence = 4.0;  ///< how much less successive images say, which show the same, where wrong places
                             ///< stay alike for several images: 0 (each says all that it shows) to 10

  /// Empty if usable, else what is wrong and what to do.
  std::string Validate() const;
};

/// Options of the geometric verification (loop-closure.md section 5).
struct VerificationOptions {
  bool enabled = true;         ///< false: every proposal is accepted as it is, without a constraint
  int max_hypotheses = 3;      ///< separate places tried, best posterior first
  int neighbours = 1;          ///< graph levels around each place that are tried as well; 0: none
  double nearer_share = 0.75;  ///< without metric points: a neighbour with this share of the inliers of the
                               ///< best view is taken in its place if the query lies less ahead of it (or
                               ///< behind) and more beside it: the nearer view of the place; 1: never, 0..1
  double match_ratio = 0.8;    ///< Lowe's ratio test, on true distance
  int min_inliers = 30;        ///< PnP: fewer inliers than this are no loop
  double min_inlier_ratio = 0.3;  ///< PnP: inliers / matches with a 3D point, 0..1
  int min_epipolar_inliers =
      30;  ///< essential, fundamental matrix: a match is held to a line only, so more are needed
  double min_epipolar_ratio = 0.3;  ///< and this share of all matches, 0..1: the probability
                                    ///< weighs it once more
  double min_spread = 0.045;  ///< standard deviation of the inliers' pixels, as a share of width and height,
                              ///< along their narrowest direction; evenly spread: 0.29, on one line: 0.
                              ///< Inliers in abundance (beyond 1.5 times the least) may lie closer, down
                              ///< to 0.6 of it
  double reprojection_px = 2.5;   ///< RANSAC threshold of PnP, Sim(3) [px]
  double epipolar_px = 1.5;       ///< RANSAC threshold of the essential and fundamental matrix [px]
  double homography_px = 2.5;     ///< RANSAC threshold of the homography [px], 0: none is sought
  double homography_share = 0.9;  ///< a homography that explains this share of what the essential or
                                  ///< fundamental matrix does decides in its place (by min_inliers and
                                  ///< min_epipolar_ratio): flat scene, or turn on the spot; above 0,
                                  ///< at most 1
  double camera_share = 1.0;   ///< of several cameras in an image each that sees much must find this share of
                               ///< the least number of inliers / cameras; 0: one may speak for all, 0..1
  double static_px = 1.5;      ///< matches nearer than this to their own pixel did not move: if
                               ///< they are most of the inliers and in a part of the image only,
                               ///< the others must do [px], 0: off
  bool scale_bar = false;      ///< the least numbers of inliers are for features of
                               ///< three members; true: times members / 3, at least
                               ///< 8, so that one member alone is judged as strictly
  double confidence = 0.9999;  ///< of RANSAC
  int max_iterations = 1000;   ///< of RANSAC
  double pixel_sigma = 1.5;    ///< standard deviation of a matched pixel, sets the information matrix [px]
  double min_depth_m = 0.1;    ///< depths outside of the range count as unknown [m]
  double max_depth_m = 80.0;   ///< [m]

  /// Empty if usable, else what is wrong and what to do.
  std::string Validate() const;
};

/// Options of the member `dnn`: a network of the caller's that describes an image as a whole (loop-closure.md
/// section 3). It gets one image of 3 channels, its first output is the descriptor. The names are those of
/// cv::dnn::blobFromImage; the defaults what nearly every network expects that was trained on ImageNet.
struct DnnOptions {
  std::string model;  ///< ONNX file; required where members holds `dnn`
  int width = 320;    ///< of the image that the network gets [px], 16 to 4096; ours are scaled to it
  int height = 240;   ///< [px], 16 to 4096
  std::array<double, 3> mean = {123.675, 116.28, 103.53};  ///< subtracted from each channel, in the order
                                                           ///< that the network has them [grey levels of 255]
  double scale = 1.0 / 255.0;  ///< and then multiplied by this, above 0, at most 1000
  std::array<double, 3> stddev = {0.229, 0.224, 0.225};  ///< and divided by this, above 0, at most 1000
  bool swap_rb = true;  ///< the network takes red, green, blue; false: blue, green, red, as OpenCV has them
  std::string layer;    ///< whose output is the descriptor, as the ONNX file names it; empty: the only output

  /// Empty if usable, else what is wrong and what to do.
  std::string Validate() const;
};

/// Options of LoopDetector.
struct LoopDetectorOptions {
  CombinationRule rule = CombinationRule::kJoint;  ///< how members are combined
  std::vector<std::string> members = {"surf", "sift",
                                      "orb"};  ///< of KnownMembers(), and of external_members; kSingle: one
  std::vector<std::string> dense_members;  ///< of external_members, those that describe an image as a whole:
                                           ///< no keypoints, and one row of CV_32F
  std::vector<std::string> external_members;  ///< further names that members may hold: the caller extracts
                                              ///< their features himself and gives them with each LoopQuery
  double loop_threshold = 0.975;              ///< accept a loop of this probability, 0..1
  double propose_threshold = 0.1;             ///< go to verification at H >= this, 0..1
  double link_threshold = 0.9;  ///< a loop of this probability links its two places for the filter, 0..1
  int stm_size = 10;            ///< locations in short-term memory, no candidates
  int threads = 2;              ///< most threads that Detect uses at once
  std::uint64_t seed = 1;       ///< of kd-forests and RANSAC

  EvidenceOptions evidence;                            ///< what a score says of a place
  LikelihoodKind likelihood = LikelihoodKind::kTfIdf;  ///< score of standardised evidence
  int island_levels = 0;      ///< candidates are ranked by the posterior of all within so many graph levels,
                              ///< 0: by their own (islands as in iBoW-LCD, Garcia-Fidalgo & Ortiz 2018)
  int consistent_images = 0;  ///< go to verification only if the candidates of so many images before lie on
                              ///< one path with this one, 0: at once
  double hypothesis_ratio = 0.0;  ///< and at H >= this x the H of the image before, 0: whatever it was (0.9
                                  ///< in Labbe & Michaud 2013), 0..1
  double bad_signature_ratio =
      0.2;  ///< a member sits out below this share of its mean number of features, 0..1
  bool ignore_bad_signatures = false;  ///< an image that is bad for every member is no location at all
  double virtual_place_prior = 0.9;    ///< p(new place | new place), 0..1
  bool rehearsal = false;              ///< merge a location into its predecessor when they look the same
  double rehearsal_similarity = 0.6;   ///< similarity from which on they do, 0..1

  MemoryKind memory = MemoryKind::kShared;  ///< shared, or one for each member
  int wm_limit = 10000;  ///< most locations in working memory, others go to long-term memory; 0: no limit
  double time_budget_ms =
      0;              ///< transfer locations as well while an image takes longer than this [ms]; 0: off.
                      ///< What is transferred then depends on the machine: results are not reproducible
  int retrieval = 2;  ///< locations brought back from long-term memory per image, near the hypothesis
  double recent_share = 0.2;  ///< share of working memory, the newest, that is never transferred, 0..1
  std::string ltm_file;  ///< SQLite file of the long-term memory; all that Detect learns is stored in it, and
                         ///< a later detector with the same file goes on from there. Empty: a temporary one

  bool keep_posterior = false;  ///< fill LoopResult::posterior_by_location (costs O(locations) per image)
  bool keep_evidence = false;   ///< fill LoopResult::posterior_by_location and MemberOpinion::evidence (costs
                                ///< O(locations x members) per image)

  ExtractionOptions extraction;      ///< features
  VocabularyOptions vocabulary;      ///< words
  VerificationOptions verification;  ///< geometry
  DnnOptions dnn;                    ///< of the member `dnn`, off by default

  /// Empty if usable, else what is wrong and what to do.
  std::string Validate() const;
};

/// A published set of parameters (loop-closure.md section 9) on top of `options`: "paper-2013" (Labbe &
/// Michaud 2013), "rtabmap-0.8.3" (the reference system of the ensemble's paper), "standardised-mean" (the
/// ensemble's paper: standardised evidence, mean of the posteriors, every loop that geometry accepts), or
/// "default" (ours).
/// Features (but their number) and verification (but min_epipolar_ratio) stay as they are. Throws InputError
/// that names the nearest word.
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

/// Members with keypoints: surf, sift, orb, akaze, brisk, kaze, gftt (corners with upright BRIEF), and what
/// RegisterFeatureType added.
std::vector<std::string> KnownFeatureTypes();

/// Members that describe an image as a whole (dense.h): hog, dnn.
std::vector<std::string> KnownDenseMembers();

}  // namespace tutti
