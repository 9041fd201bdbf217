#include "apps/tutti/evaluation_report.h"

#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

using Json = nlohmann::ordered_json;

Json StatisticsJson(const ErrorStatistics& s) {
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.std},
          {"min", s.min},   {"max", s.max},   {"sse", s.sse},       {"count", s.count}};
}

Json SegmentsJson(const SegmentErrors& errors) {
  Json json = {{"segments", errors.segments}};
  if (errors.segments == 0) return json;
  json["t_rel_percent"] = errors.translation_percent;
  json["r_rel_deg_per_m"] = errors.rotation_deg_per_m;
  return json;
}

}  // namespace

EvaluationReport EvaluateFiles(const NamedPoses& reference, const NamedPoses& estimate,
                               const std::string& remedy, EvaluationOptions& options) {
  const PoseFile &r = reference.poses, &e = estimate.poses;
  if (r.has_stamps != e.has_stamps) {
    throw InputError((r.has_stamps ? estimate.name : reference.name) + ": has no time stamps, but " +
                     (r.has_stamps ? reference.name : estimate.name) + " has; give " + remedy);
  }
  // Numbers in the file pair as stamps do; KITTI's lines must be equally many.
  options.by_index = !r.has_stamps && !r.has_numbers && !e.has_numbers;
  try {
    return EvaluateTrajectory(r.trajectory, e.trajectory, options,
                              {r.rotations_as_written, e.rotations_as_written});
  } catch (const InputError& error) {
    throw InputError(estimate.name + " against " + reference.name + ": " + error.what());
  }
}

nlohmann::ordered_json ReportJson(const EvaluationReport& r, const EvaluationOptions& o) {
  const Similarity& S = r.S_reference_estimate;
  const Eigen::Quaterniond& q = S.rotation;
  const auto known = [](const ErrorStatistics& s) { return s.count > 0 ? StatisticsJson(s) : Json(); };
  Json json;
  json["pairs"] = r.pairs;
  json["reference_poses"] = r.reference_poses;
  json["estimate_poses"] = r.estimate_poses;
  json["path_length_m"] = r.path_length_m;
  json["association"] = {{"by", o.by_index      ? "line"
                                : o.interpolate ? "interpolation"
                                                : "time"},
                         {"max_time_difference_s", o.max_time_difference_s},
                         {"time_offset_s", o.time_offset_s},
                         {"reference_unmatched", r.association.reference_unmatched},
                         {"estimate_unmatched", r.association.estimate_unmatched},
                         {"time_difference_s",
                          {{"median", r.association.median_time_difference_s},
                           {"largest", r.association.largest_time_difference_s}}}};
  json["coverage"] = {{"share", r.coverage.share()},
                      {"posed", r.coverage.posed},
                      {"all", r.coverage.all},
                      {"full", r.coverage.share() >= kFullCoverage},
                      {"unpaired", r.coverage.unpaired}};
  json["alignment"] = {{"mode", ToString(r.alignment)},
                       {"first_poses", o.align_first},
                       {"scale", S.scale},
                       {"translation", {S.translation.x(), S.translation.y(), S.translation.z()}},
                       {"quaternion_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
  json["plane"] = ToString(o.plane);
  json["ate"] = StatisticsJson(r.ate);
  json["rotations"] = r.rotations;
  json["ate_rotation_deg"] = known(r.ate_rotation);
  json["ate_full"] = known(r.ate_full);
  json["rpe"] = {{"delta", o.rpe_delta},
                 {"unit", ToString(o.rpe_unit)},
                 {"all_pairs", o.rpe_all_pairs},
                 {"translation", known(r.rpe)},
                 {"rotation_deg", known(r.rpe_rotation)},
                 {"full", known(r.rpe_full)},
                 {"point_distance", known(r.rpe_point_distance)},
                 {"point_distance_percent", known(r.rpe_point_distance_ratio)}};
  json["kitti"] = SegmentsJson(r.kitti);
  json["drift"] = SegmentsJson(r.drift);
  return json;
}

}  // namespace tutti::cli
