// What a report says of one run, as JSON: the page draws it, and a comparison puts several of them together.
// For that a log keeps what the loop detector said of every image, small enough to be kept for a whole run.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "apps/run/run_observer.h"
#include "apps/run/run_result.h"

namespace tutti {

/// The logarithm of a likelihood in one byte, in steps of 0.1 from -10 to 15.4; 0: there is none.
struct EvidenceByte {
  static constexpr int kZero = 101;     ///< stands for ln L = 0: as likely as a new place
  static constexpr double kStep = 0.1;  ///< in ln L
  /// The byte of a likelihood; values beyond the range take its nearest end.
  static std::uint8_t Of(double likelihood);
};

/// One opinion: a member's or the ensemble's.
struct LoggedOpinion {
  std::string name;        ///< "surf", ..., "ensemble"
  bool took_part = true;   ///< false: the member sat the image out
  double hypothesis = 0;   ///< 1 - p(new place)
  std::int64_t best = -1;  ///< input frame of the best location, -1: none
  /// (input frame of a location, its posterior), where that is at least DetectionLog::kLeastPosterior
  std::vector<std::pair<std::int64_t, float>> posterior;
  double weight = 0;        ///< of a member: share of the sum of all that took part, 0..1; 0: it did not
  double at_candidate = 0;  ///< its posterior at the ensemble's best place, 0..1
  /// What a member, or the joint filter, has by group of LoggedDetection::group images in the order of the
  /// queries: the EvidenceByte of its largest likelihood; images at the end that are no places yet are left
  /// out
  std::vector<std::uint8_t> evidence;
};

/// One image that the detector was asked about.
struct LoggedDetection {
  std::int64_t query = -1;  ///< index of the input frame
  double stamp_s = 0;
  bool proposed = false, verified = false;
  double probability = 0;       ///< LoopResult::probability
  std::int64_t candidate = -1;  ///< the input frame that the verification tried last best, else the best one
  std::string reason;           ///< why it is no loop; empty if it was verified
  double posterior = 0;         ///< of the ensemble at its best location, 0..1
  Verification geometry;        ///< the best one tried, without its inlier_matches; candidate -1: none was
  std::size_t group = 1;        ///< images to an element of LoggedOpinion::evidence
  std::vector<LoggedOpinion> opinions;  ///< the members in their order, then "ensemble"
  /// pixels of inliers in the query and in the candidate, kMostMatches at most, spread over all
  std::vector<std::pair<cv::Point2f, cv::Point2f>> matches;
};

/// Collects them during a run.
class DetectionLog : public RunObserver {
 public:
  static constexpr double kLeastPosterior = 1e-3;  ///< smaller ones are left out: there is one per location
  static constexpr std::size_t kMostMatches = 60;
  static constexpr std::size_t kMostGroups = 512;  ///< of places in LoggedOpinion::evidence
  static constexpr std::size_t kMostLandmarks = 3000;

  bool WantsPosteriors() const override { return true; }
  void OnRestart() override { *this = DetectionLog(); }
  void OnFrame(const InputFrame& frame, const TrackResult& track, const RunState& state) override;
  void OnDetection(const LoopResult& result) override;
  void OnEnd(const RunState& state) override;
  const char* Name() const override { return "detections"; }
  std::string Save() const override;
  void Load(const std::string& bytes, const std::string& source) override;

  /// In the order of the queries.
  const std::vector<LoggedDetection>& detections() const { return detections_; }
  /// Landmarks of the largest submap at the end of the run, in its world: kMostLandmarks at most, spread over
  /// all, without those that lie far from the others.
  const std::vector<Eigen::Vector3d>& landmarks() const { return landmarks_; }

 private:
  std::vector<std::uint8_t> Grouped(const std::vector<CandidateEvidence>& evidence, std::size_t group) const;

  std::map<std::int64_t, double> stamps_;        // of frames whose answer may still come
  std::map<std::int64_t, std::size_t> numbers_;  // of queries, in detections_
  std::vector<LoggedDetection> detections_;
  std::vector<Eigen::Vector3d> landmarks_;
};

/// Everything that the page shows of a run. `variant`: "ensemble", "odometry", or the rule. Reads images of
/// the data set again for the gallery, unless each can be read only once. Lengths [m] (mono without a
/// reference: map units), times [s] or [ms] as the names say. Deterministic but for the timings.
nlohmann::ordered_json RunReport(const RunResult& result, const DetectionLog& log,
                                 const std::string& variant);

/// "odometry" without loops, "ensemble" for the rule joint, "seed" for standardised-mean, else the rule.
std::string VariantName(const RunConfig& config);

}  // namespace tutti
