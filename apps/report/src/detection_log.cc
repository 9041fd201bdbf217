#include "tutti/report/detection_log.h"

#include <algorithm>

namespace tutti {
namespace {

std::vector<std::pair<std::int64_t, float>> Noteworthy(
    const std::vector<std::pair<std::int64_t, double>>& posterior) {
  std::vector<std::pair<std::int64_t, float>> out;
  for (const auto& [location, p] : posterior) {
    if (p >= DetectionLog::kLeastPosterior) out.emplace_back(location, static_cast<float>(p));
  }
  return out;
}

std::vector<std::pair<cv::Point2f, cv::Point2f>> SpreadMatches(const std::vector<VerifiedMatch>& all) {
  std::vector<std::pair<cv::Point2f, cv::Point2f>> out;
  const std::size_t count = std::min(all.size(), DetectionLog::kMostMatches);
  for (std::size_t k = 0; k < count; ++k) {
    const VerifiedMatch& match = all[k * all.size() / count];
    out.emplace_back(match.query, match.candidate);
  }
  return out;
}

}  // namespace

void DetectionLog::OnFrame(const InputFrame& frame, const TrackResult& track, const SlamSystem& slam) {
  if (track.keyframe >= 0 || slam.AppearanceOnly()) stamps_[frame.index] = frame.stamp_s;
}

void DetectionLog::OnDetection(const LoopResult& result) {
  LoggedDetection detection;
  detection.query = result.query;
  const auto stamp = stamps_.find(result.query);
  if (stamp != stamps_.end()) detection.stamp_s = stamp->second;
  stamps_.erase(stamps_.begin(), stamps_.upper_bound(result.query));
  detection.proposed = result.proposed;
  detection.verified = result.accepted;
  detection.probability = result.probability;
  detection.candidate = result.verification.candidate >= 0 ? result.verification.candidate : result.candidate;
  detection.reason = result.reason.empty() && !result.accepted ? result.verification.reason : result.reason;
  for (const MemberOpinion& member : result.members) {
    detection.opinions.push_back({member.name, member.took_part, member.hypothesis, member.best,
                                  Noteworthy(member.posterior_by_location)});
  }
  detection.opinions.push_back(
      {"ensemble", true, result.hypothesis, result.candidate, Noteworthy(result.posterior_by_location)});
  if (result.proposed) detection.matches = SpreadMatches(result.verification.inlier_matches);
  detections_.push_back(std::move(detection));
}

}  // namespace tutti
