// What is kept of the loop detector's answers.
#include <algorithm>
#include <cmath>
#include <set>

#include "apps/report/run_report.h"
#include "apps/slam/map_state.h"
#include "core/state_archive.h"

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

// Those that are within the middle 96 % along each axis, and as much again.
std::vector<Eigen::Vector3d> WithoutFarOnes(const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3d> kept = points;
  for (int axis = 0; axis < 3 && points.size() > 10; ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& p : points) values.push_back(p[axis]);
    std::sort(values.begin(), values.end());
    const double low = values[values.size() / 50], high = values[values.size() - 1 - values.size() / 50];
    const double room = 0.5 * (high - low);
    kept.erase(std::remove_if(kept.begin(), kept.end(),
                              [&](const Eigen::Vector3d& p) {
                                return !(p[axis] >= low - room && p[axis] <= high + room);
                              }),
               kept.end());
  }
  return kept;
}

// What the members that took part have to say among themselves.
double SumOfWeights(const std::vector<MemberOpinion>& members) {
  double sum = 0;
  for (const MemberOpinion& member : members) sum += member.took_part ? member.weight : 0.0;
  return sum;
}

}  // namespace

std::uint8_t EvidenceByte::Of(double likelihood) {
  const double steps = kZero + std::log(std::max(likelihood, 1e-300)) / kStep;
  return static_cast<std::uint8_t>(std::lround(std::clamp(steps, 1.0, 255.0)));
}

// One byte for so many images: with one for each, a long run's log would grow with its square.
std::vector<std::uint8_t> DetectionLog::Grouped(const std::vector<CandidateEvidence>& evidence,
                                                std::size_t group) const {
  std::vector<std::uint8_t> out;
  for (const CandidateEvidence& place : evidence) {
    const auto number = numbers_.find(place.location);
    if (number == numbers_.end()) continue;
    const std::size_t at = number->second / group;
    if (at >= out.size()) out.resize(at + 1, 0);
    out[at] = std::max(out[at], EvidenceByte::Of(place.likelihood));
  }
  return out;
}

void DetectionLog::OnFrame(const InputFrame& frame, const TrackResult& track, const RunState& state) {
  if (track.keyframe >= 0 || state.odometry == nullptr) stamps_[frame.index] = frame.stamp_s;
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
  detection.candidate = result.candidate;
  detection.reason = result.reason.empty() && !result.accepted ? result.verification.reason : result.reason;
  detection.posterior = result.posterior;
  detection.geometry = result.verification;
  detection.geometry.inlier_matches.clear();
  detection.geometry.inlier_matches.shrink_to_fit();
  while (detections_.size() / detection.group >= kMostGroups) detection.group *= 2;
  const double sum = SumOfWeights(result.members);
  for (const MemberOpinion& member : result.members) {
    const double weight = member.took_part && sum > 0 ? member.weight / sum : 0.0;
    detection.opinions.push_back({member.name, member.took_part, member.hypothesis, member.best,
                                  Noteworthy(member.posterior_by_location), weight, member.at_candidate,
                                  Grouped(member.evidence, detection.group)});
  }
  detection.opinions.push_back({"ensemble", true, result.hypothesis, result.best,
                                Noteworthy(result.posterior_by_location), 0, result.posterior,
                                Grouped(result.evidence, detection.group)});
  numbers_[result.query] = detections_.size();
  if (result.proposed) detection.matches = SpreadMatches(result.verification.inlier_matches);
  detections_.push_back(std::move(detection));
}

void DetectionLog::OnEnd(const RunState& state) {
  landmarks_.clear();
  if (state.odometry == nullptr) return;
  const Map& map = state.odometry->map();
  const std::vector<int> pieces = FramePieces(map);
  std::set<int> seen;  // by keyframes of the largest piece, if there are others
  for (const int id : map.KeyframeIds()) {
    if (pieces.size() < 2 || map.keyframe(id).piece != pieces.front()) continue;
    for (const int landmark : map.keyframe(id).landmarks) seen.insert(landmark);
  }
  std::vector<Eigen::Vector3d> all;
  for (const int id : map.LandmarkIds()) {
    if (pieces.size() < 2 || seen.count(id) > 0) all.push_back(map.landmark(id).position);
  }
  all = WithoutFarOnes(all);
  const std::size_t count = std::min(all.size(), kMostLandmarks);
  for (std::size_t k = 0; k < count; ++k) landmarks_.push_back(all[k * all.size() / count]);
}

template <class Archive>
void State(Archive& archive, LoggedOpinion& o) {
  archive(o.name, o.took_part, o.hypothesis, o.best, o.posterior, o.weight, o.at_candidate, o.evidence);
}

template <class Archive>
void State(Archive& archive, LoggedDetection& d) {
  archive(d.query, d.stamp_s, d.proposed, d.verified, d.probability, d.candidate, d.reason, d.posterior,
          d.geometry, d.group, d.opinions, d.matches);
}

std::string DetectionLog::Save() const {
  internal::SharedObjectsOut shared;
  internal::StateWriter out(&shared);
  out(stamps_, numbers_, detections_);
  return out.Take();
}

void DetectionLog::Load(const std::string& bytes, const std::string& source) {
  internal::SharedObjectsIn shared;
  internal::StateReader in(bytes, source, &shared);
  in(stamps_, numbers_, detections_);
  in.ExpectEnd();
}

}  // namespace tutti
