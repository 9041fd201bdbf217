// The one class that ties the loop-closure module together: image in, verified loop (or the reason why not)
// out.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"
#include "tutti/loopclosure/detector_options.h"
#include "tutti/loopclosure/features.h"

#pragma GCC visibility push(default)
namespace tutti {

namespace internal {
class SavedDetector;
class SectionReader;
}  // namespace internal

/// Features that the caller already has, used for geometric verification beside the members' own.
struct FeatureSet {
  std::vector<cv::KeyPoint> keypoints;  ///< size N
  cv::Mat descriptors;                  ///< N rows; CV_8U: Hamming, CV_32F: Euclidean
  std::vector<Eigen::Vector3d> points;  ///< empty, or N points in the camera frame [m]; NaN where unknown
};

/// Where the caller's odometry believes an image to be taken: places that it can't have come back to lose,
/// and among those that look alike the nearer one gains. The odometry drifts: its position relative to a
/// place has a standard deviation of sigma_m + drift s, with s the way since then, summed over the positions
/// given. Positions are not saved: after Load, and with a store of an earlier run, places of before have
/// none.
struct PosePrior {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< of the camera [m], in the odometry's world
  std::int64_t frame = 0;  ///< number of that world: positions in different ones are not compared
  double sigma_m = 5.0;    ///< how far apart one place is seen from, without any drift [m], above 0
  double drift = 0.05;     ///< growth of the standard deviation with the way [m/m], 0 or more
};

/// One image with what is known about it.
struct LoopQuery {
  std::int64_t id = 0;  ///< strictly greater than every id before
  double stamp_s = 0;   ///< when it was taken [s]; for the caller's own records, decides nothing
  cv::Mat image;  ///< CV_8UC1, CV_8UC3 (BGR) or CV_16UC1; rectified if a camera is given. May be empty where
                  ///< member_features has all members
  cv::Mat depth_m;                      ///< optional: CV_32FC1 [m], registered to image, 0 = unknown
  std::optional<PinholeCamera> camera;  ///< optional: without it verification uses the fundamental matrix
  cv::Mat mask;                         ///< optional: CV_8UC1, as large as image; features where it is
                                        ///< 0 do not exist (robot's own parts, rim, burnt-in text)
  std::vector<cv::Rect> cameras;        ///< optional: image is of several cameras, each in a rectangle
                                        ///< of its own, left to right: each has a geometry of its own.
                                        ///< Not with `camera`. Empty: one camera
  FeatureSet features;                  ///< optional: the caller's own features
  std::map<std::string, Features> member_features;  ///< optional: members that need not extract, by
                                                    ///< name; one of options.external_members: required
  std::optional<PosePrior> pose_prior;  ///< optional: only what drifts slowly and has a fixed scale
  bool metric = true;  ///< features.points are in metres (stereo, RGB-D): PnP, kRigid. false: mono, their
                       ///< scale drifts: essential matrix, then kSimilarity where both have points
};

/// What one member had to say of one location in working memory (loop-closure.md section 2).
struct CandidateEvidence {
  std::int64_t location = -1;  ///< id
  double score = 0;            ///< raw score s_i of LikelihoodModel::Scores; 0: no word shared
  double likelihood = 1;       ///< L_i of AdjustLikelihood; 1: does not stand out
  double posterior = 0;        ///< of its own Bayes filter, 0..1
};

/// What one member (or the whole ensemble) believes.
struct MemberOpinion {
  std::string name;         ///< "surf", "sift", "orb", ...
  bool took_part = false;   ///< false: bad signature, the member sat this image out
  int features = 0;         ///< found in this image; a dense member has one, or none
  int words = 0;            ///< in its vocabulary by now
  double hypothesis = 0;    ///< H = 1 - p(new place)
  std::int64_t best = -1;   ///< id of its best location, -1 if none
  double weight = 1;        ///< rule joint: of its counts in the sum of all, 1 in the mean
  double at_candidate = 0;  ///< its posterior at the ensemble's best location
  std::vector<std::pair<std::int64_t, double>> posterior_by_location;  ///< only with keep_posterior
  std::vector<CandidateEvidence> evidence;  ///< only with keep_evidence: of every location in working memory,
                                            ///< in one order for all members; empty if it did not take part.
                                            ///< Rule naive: of all members' words together
};

/// A matched feature: pixel in the query and in the candidate, and their indices in the callers' FeatureSets
/// (-1: a member's).
struct VerifiedMatch {
  cv::Point2f query;           ///< pixel in the query's image [px]
  cv::Point2f candidate;       ///< pixel in the candidate's image [px]
  int query_feature = -1;      ///< index in the query's LoopQuery::features, -1: a member's
  int candidate_feature = -1;  ///< index in the candidate's LoopQuery::features, -1: a member's
};

/// What geometry says about two images (loop-closure.md section 5).
enum class ConstraintType {
  kNone,         ///< nothing: too few matches, or verification is off
  kFundamental,  ///< no camera given: they show the same scene, no pose
  kEssential,    ///< camera, no points: rotation and direction of the translation
  kRigid,        ///< points in metres: pose in SE(3), with information
  kSimilarity,   ///< mono with points of a drifting scale: pose and scale in Sim(3), with information
};
/// "none", "fundamental", "essential", "rigid", "similarity".
const char* ToString(ConstraintType type);

/// Outcome of the geometric verification of one candidate.
struct Verification {
  std::int64_t candidate = -1;  ///< id of the location it was tried with, -1: none was
  bool similar = false;   ///< so many matches fit one motion (verification.min_place_inliers) that the images
                          ///< may show one place, whatever the motion is worth
  bool accepted = false;  ///< and the motion is certain enough for a constraint
  ConstraintType type = ConstraintType::kNone;  ///< which geometry decided
  Similarity S_candidate_query;  ///< maps points of the query camera into the candidate camera (kRigid:
                                 ///< scale 1; kEssential: rotation and unit direction only; where the camera
                                 ///< only turned, the rotation and no translation)
  Matrix6d information = Matrix6d::Zero();  ///< of (translation [m], rotation [rad]), from the inliers
  bool homography = false;                  ///< kEssential, kFundamental: a homography explains nearly all,
                                            ///< and decided: the scene is flat or the camera turned on the
                                            ///< spot. The direction of the translation is then that of the
                                            ///< essential matrix, one of two for a plane
  int matches = 0;                          ///< that were considered (kRigid: those with a 3D point)
  int inliers = 0;                          ///< of these, those that fit one camera motion
  int coverage = 0;  ///< cells of a grid of 8x6 that inliers occupy, in the image with fewer, 0..48
  double expected_inliers = 0;  ///< of so many matches, those that chance lets fit: the sample and the share
                                ///< of the image that lies within the threshold of where a match has to be
  double log_nfa = 0;  ///< log10 of the number of false alarms (Moisan & Stival 2004): motions that chance
                       ///< lets as many matches fit; the further below 0 the surer that one motion moved
                       ///< them. That says "one scene or one object", not yet "one place"
  double motion_spread = 0;  ///< standard deviation of the inliers' displacements between the images, as a
                             ///< share of the diagonal; 0: all moved as one. Small where a place is
                             ///< seen from where it was seen, mostly large where another looks alike
  double mass = 0;     ///< posterior of all places within 4 graph levels of the candidate, over that and
                       ///< of a new place, 0..1: which of several places it is geometry knows better
  std::string reason;  ///< why not, in plain words; empty if accepted
  std::vector<VerifiedMatch> inlier_matches;  ///< the inliers
};

/// A second word about an image, some images later (loop-closure.md section 5).
struct LateLoop {
  std::int64_t query = -1;    ///< id of the image that it is about
  bool accepted = false;      ///< its loop with verification.candidate is accepted now, and was not before
  bool withdrawn = false;     ///< its loop was accepted before, and is not any more
  double probability = 0;     ///< that it is a loop, by all that is known now, 0..1
  Verification verification;  ///< of the place that this is about
};

/// Everything that Detect found out.
struct LoopResult {
  std::int64_t query = -1;             ///< id of the image
  double hypothesis = 0;               ///< H of the combined posterior, 1 - p(new place)
  std::int64_t candidate = -1;         ///< the place that this is about: the loop if accepted, else the one
                                       ///< that geometry came closest to, or where it looked at none `best`
  std::int64_t best = -1;              ///< argmax of the combined posterior, -1 if there is no location yet
  double posterior = 0;                ///< combined posterior at `best`
  double probability = 0;              ///< that this is a loop: with the verified place, else the candidate
  bool proposed = false;               ///< H >= propose_threshold: went to verification
  bool accepted = false;               ///< the verification accepted it (or one of its neighbours), and the
                                       ///< probability is at least loop_threshold. A place that geometry
                                       ///< finds `similar` alone is said by a second word (LateLoop)
  std::string reason;                  ///< why it is not accepted, in plain words
  std::vector<MemberOpinion> members;  ///< in the order of options.members
  Verification verification;           ///< the best one tried
  std::vector<Verification> tried;     ///< all that were tried
  std::optional<LateLoop> late;        ///< what this image changes for an earlier one; nothing: nothing
  /// The combined posterior of every location in working memory; only with keep_posterior or keep_evidence.
  std::vector<std::pair<std::int64_t, double>> posterior_by_location;
  /// What the joint filter got: its score is the sum of the members' counts, each times its weight. Only with
  /// keep_evidence and rule joint, in the order of posterior_by_location; empty if no member took part.
  std::vector<CandidateEvidence> evidence;
  std::vector<std::int64_t> retrieved;    ///< locations that came back from long-term memory
  std::vector<std::int64_t> transferred;  ///< locations that left working memory for it
  std::string warning;  ///< trouble that did not stop Detect: the disk is full, a stored location is damaged
  double extract_ms = 0;     ///< wall time of features [ms]
  double quantise_ms = 0;    ///< of words [ms]
  double likelihood_ms = 0;  ///< of likelihoods [ms]
  double filter_ms = 0;      ///< of Bayes filters and their combination [ms]
  double verify_ms = 0;      ///< of geometric verification [ms]
  double memory_ms = 0;      ///< of memory: rehearsal, retrieval, transfer, storing [ms]
};

/// What a detector keeps of a location: enough to show the place to another detector.
struct LoopPlace {
  std::int64_t id = -1;                             ///< LoopQuery::id
  std::optional<PinholeCamera> camera;              ///< LoopQuery::camera
  std::map<std::string, Features> member_features;  ///< for LoopQuery::member_features
};

/// Ensemble loop-closure detector (loop-closure.md sections 1 to 6). Not thread-safe: one caller at a time.
/// Deterministic for any number of threads.
class LoopDetector {
 public:
  /// Throws InputError if the options are not usable; or if ltm_file can't be used: it is in use by another
  /// process, damaged, or belongs to other members or another kind of memory. A file with locations is gone
  /// on with: all of them are there again, the filters start afresh.
  explicit LoopDetector(const LoopDetectorOptions& options);
  /// Moves; what was moved from can only be destroyed or assigned to.
  LoopDetector(LoopDetector&&) noexcept;
  /// Moves; what was moved from can only be destroyed or assigned to.
  LoopDetector& operator=(LoopDetector&&) noexcept;
  ~LoopDetector();

  /// Adds the image as a location and says whether it closes a loop. Never throws for hard images; throws
  /// InputError for misuse (an id that does not grow, descriptors of another type than before).
  LoopResult Detect(const LoopQuery& query);
  /// Detects in an image alone: CV_8UC1, CV_8UC3 (BGR) or CV_16UC1.
  LoopResult Detect(const cv::Mat& image, std::int64_t id);

  /// Says at which location in working memory an image was taken, for a camera that has lost its way: by
  /// this image alone (no filter) and always verified, unless verification is off for this detector (then
  /// nothing is accepted). Adds nothing, changes nothing; `id` only names the query. Throws InputError for
  /// misuse, as Detect does.
  LoopResult Locate(const LoopQuery& query) const;

  /// Another recording begins, which may start anywhere: the locations of short-term memory become
  /// candidates, and the filters start from "all places are as likely". Ids must go on to grow.
  void BeginSession();
  /// The odometry's world is another one from now on: positions of before (PosePrior) say nothing any more.
  void ForgetPositions();

  /// Adds a neighbour link between two locations (a caller's own odometry link); consecutive ids are linked
  /// by themselves.
  void AddLink(std::int64_t a, std::int64_t b);
  /// Takes back the loop between two locations, that Detect accepted and the caller has found to be false
  /// (the pose graph contradicts it): the filter no longer takes their places for one. Ids that are unknown,
  /// or not linked by a loop, are no error.
  void Unlink(std::int64_t a, std::int64_t b);
  /// Forgets what a location looks like, since an older one, `into`, shows the same place: that has its links
  /// from then on. False, and nothing happens, if one of the two is not there, if `into` is not older, or if
  /// `id` is the newest of all. With ltm_file, the file learns of it with the next image.
  bool Merge(std::int64_t id, std::int64_t into);

  /// Saves everything (vocabularies, memory with its long-term part, filters) into one file; a file that is
  /// there is replaced only by a complete one. Throws InputError if it can't be written.
  void Save(const std::filesystem::path& file) const;
  /// Takes up what Save wrote, in place of all that this object knows; it then goes on exactly as the saved
  /// one would have, if the options are the same. Members, their extraction and kind of memory must be.
  /// Throws InputError for another version, other members, or a damaged file; the object is then as it was.
  void Load(const std::filesystem::path& file);

  /// For files that hold more than a detector (maps of tutti::slam): gives what Save writes to `sink`,
  /// section by section, with the positions of the queries (PosePrior).
  void SaveSections(const std::function<void(std::uint32_t tag, std::string_view bytes)>& sink) const;
  /// Takes up what SaveSections gave, from the next sections of a file. Throws InputError as Load does; the
  /// object is then as it was.
  void LoadSections(internal::SectionReader* file);

  /// All locations, long-term memory included, in the order of their ids; not those that rehearsal merged
  /// into others. Throws InputError for a dense member, which keeps no features, and if the long-term memory
  /// can't be read.
  std::vector<LoopPlace> Places() const;

  /// Locations in short-term and working memory.
  std::size_t NumLocations() const;
  /// Locations in long-term memory.
  std::size_t NumLongTerm() const;
  /// The last id that Detect was given; -1 if there was none.
  std::int64_t LastId() const;
  /// What was given; after Load with the saved detector's seed.
  const LoopDetectorOptions& options() const;

 private:
  class Impl;
  void Take(internal::SavedDetector* saved);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tutti
#pragma GCC visibility pop
