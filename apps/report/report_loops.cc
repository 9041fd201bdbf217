// Loops by outcome, and precision-recall curves.
#include <algorithm>
#include <cstdio>
#include <set>

#include "apps/report/report_parts.h"
#include "tutti/backend/evaluation.h"
#include "tutti/loopclosure/evaluation.h"

namespace tutti::report {
namespace {

constexpr std::size_t kMostCurvePoints = 400;
constexpr std::size_t kMostMissed = 400;  // of the map; more are drawn on each other

// A room is not a street: with depth from the sensor, the views of one place lie closer together (the rule of
// bench/ensemble_protocol).
LoopRule RuleFor(Sensor sensor) {
  LoopRule rule;
  if (sensor != Sensor::kRgbd) return rule;
  rule.distance_m = 0.3;
  rule.angle_deg = 25;
  rule.ignore_m = 0.6;
  return rule;
}

std::string DescribeRule(const LoopRule& rule) {
  char text[160];
  std::snprintf(text, sizeof text,
                "same place: less than %g m and %g deg apart, at least %g s older; ignored: younger, or less "
                "than %g m apart",
                rule.distance_m, rule.angle_deg, rule.exclude_s, rule.ignore_m);
  return text;
}

int RowOfFrame(const KnownLoops& known, std::int64_t frame) {
  const auto row = known.row_of.find(frame);
  return row == known.row_of.end() ? -1 : row->second;
}

Json CurveJson(const std::string& name, const LoopEvaluation& evaluation) {
  Json curve = {{"name", name},
                {"area", Rounded(evaluation.area_under_curve, 4)},
                {"recall_at_100", Rounded(evaluation.recall_at_100_precision, 4)},
                {"recall", Json::array()},
                {"precision", Json::array()}};
  for (const std::size_t k : Thinned(evaluation.curve.size(), kMostCurvePoints)) {
    curve["recall"].push_back(Rounded(evaluation.curve[k].recall, 4));
    curve["precision"].push_back(Rounded(evaluation.curve[k].precision, 4));
  }
  const PrecisionRecall& at = evaluation.at_default_threshold;
  curve["at_threshold"] = {Rounded(at.recall, 4), Rounded(at.precision, 4)};
  return curve;
}

// The column of a true loop of this row, the middle one of all.
int TrueColumn(const LoopGroundTruth& truth, int row) {
  std::vector<int> columns;
  for (int c = 0; c < row; ++c) {
    if (truth.At(row, c) == LoopLabel::kLoop) columns.push_back(c);
  }
  return columns.empty() ? -1 : columns[columns.size() / 2];
}

}  // namespace

const char* ToString(Outcome outcome) {
  constexpr const char* kWords[] = {"accepted", "false", "rejected", "missed"};
  return kWords[static_cast<int>(outcome)];
}

std::vector<std::size_t> Thinned(std::size_t size, std::size_t most) {
  std::vector<std::size_t> out(std::min(size, most));
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = size <= most ? k : k * (size - 1) / (most - 1);
  return out;
}

KnownLoops FindKnownLoops(const RunResult& result, const DetectionLog& log) {
  KnownLoops known;
  if (result.reference.empty()) return known;
  Trajectory poses;
  for (std::size_t i = 0; i < log.detections().size(); ++i) {
    const LoggedDetection& detection = log.detections()[i];
    const std::optional<Pose> pose =
        PoseOfFrame(result.reference, detection.stamp_s, result.frame_interval_s);
    if (!pose) continue;
    known.row_of[detection.query] = static_cast<int>(known.images.size());
    known.images.push_back(i);
    poses.push_back({detection.stamp_s, *pose * result.rig.T_body_camera});
  }
  if (poses.empty()) return known;
  const LoopRule rule = RuleFor(result.rig.sensor);
  known.truth = LoopsFromTrajectory(poses, rule);
  known.rule = DescribeRule(rule);
  return known;
}

Json PrecisionRecallJson(const RunResult& result, const DetectionLog& log, const KnownLoops& known) {
  if (known.rule.empty() || known.truth.RowsWithLoop() == 0) return Json();
  std::map<std::string, std::vector<LoopObservation>> by_name;
  std::vector<std::string> names;
  for (std::size_t row = 0; row < known.images.size(); ++row) {
    const LoggedDetection& detection = log.detections()[known.images[row]];
    for (const LoggedOpinion& opinion : detection.opinions) {
      if (by_name.count(opinion.name) == 0) names.push_back(opinion.name);
      LoopObservation observation;
      observation.image = static_cast<int>(row);
      observation.hypothesis = opinion.took_part ? opinion.hypothesis : 0;
      observation.best = RowOfFrame(known, opinion.best);
      observation.accepted = detection.verified;
      observation.verified = detection.verified ? RowOfFrame(known, detection.candidate) : -1;
      observation.probability = detection.probability;
      observation.proposed = detection.proposed;
      by_name[opinion.name].push_back(observation);
    }
  }
  const double threshold = result.config.loops.propose_threshold;
  Json json = {{"rule", known.rule},
               {"images", known.images.size()},
               {"rows_with_loop", known.truth.RowsWithLoop()},
               {"curves", Json::array()}};
  // A member alone is what it is called already.
  const bool alone = names.size() == 2;
  for (const std::string& name : names) {
    if (alone && name != "ensemble") continue;
    json["curves"].push_back(CurveJson(name, EvaluatePosterior(by_name[name], known.truth, threshold)));
  }
  json["curves"].push_back(CurveJson("verified", EvaluateVerified(by_name["ensemble"], known.truth)));
  return json;
}

std::vector<ShownLoop> ShownLoops(const RunResult& result, const DetectionLog& log, const KnownLoops& known) {
  std::map<std::int64_t, const LoggedDetection*> detections;
  for (const LoggedDetection& detection : log.detections()) detections[detection.query] = &detection;
  std::vector<ShownLoop> loops;
  std::set<std::int64_t> accepted;
  for (const Loop& record : result.loops) {
    ShownLoop loop;
    loop.outcome = !record.accepted()              ? Outcome::kRejected
                   : record.correct.value_or(true) ? Outcome::kAccepted
                                                   : Outcome::kFalse;
    loop.query = record.query;
    loop.candidate = record.candidate;
    loop.query_stamp_s = record.query_stamp_s;
    loop.candidate_stamp_s = record.candidate_stamp_s;
    loop.hypothesis = record.hypothesis;
    loop.probability = record.probability;
    loop.inliers = record.inliers;
    loop.matches = record.matches;
    loop.reason = record.reason;
    const auto detection = detections.find(record.query);
    if (detection != detections.end()) loop.detection = detection->second;
    if (record.accepted()) accepted.insert(record.query);
    loops.push_back(loop);
  }
  std::vector<ShownLoop> missed;
  for (std::size_t row = 0; row < known.images.size(); ++row) {
    const LoggedDetection& detection = log.detections()[known.images[row]];
    const int column = TrueColumn(known.truth, static_cast<int>(row));
    if (column < 0 || accepted.count(detection.query) != 0) continue;
    const LoggedDetection& past = log.detections()[known.images[static_cast<std::size_t>(column)]];
    ShownLoop loop;
    loop.outcome = Outcome::kMissed;
    loop.query = detection.query;
    loop.candidate = past.query;
    loop.query_stamp_s = detection.stamp_s;
    loop.candidate_stamp_s = past.stamp_s;
    loop.hypothesis = detection.opinions.empty() ? 0 : detection.opinions.back().hypothesis;
    loop.probability = detection.probability;
    loop.reason = detection.reason.empty() ? "verified, but not taken into the pose graph" : detection.reason;
    loop.detection = &detection;
    missed.push_back(loop);
  }
  for (const std::size_t k : Thinned(missed.size(), kMostMissed)) loops.push_back(missed[k]);
  return loops;
}

}  // namespace tutti::report
