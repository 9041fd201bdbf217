#include "apps/report/run_report.h"

#include <algorithm>
#include <cmath>

#include "apps/report/report_parts.h"
#include "apps/run/outputs.h"
#include "apps/run/run_parts.h"
#include "apps/run/timing.h"
#include "core/numbers.h"
#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"
#include "tutti/slam/version.h"

namespace tutti {
namespace report {
namespace {

constexpr std::size_t kMostPoses = 2000;  // of a trajectory
constexpr std::size_t kMostErrors = 1500;
constexpr std::size_t kMostFrameTimes = 1000;

Json PointsJson(const std::vector<Eigen::Vector3d>& points, const Similarity& alignment, int decimals) {
  Json x = Json::array(), y = x, z = x;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d p = alignment * point;
    x.push_back(Rounded(p.x(), decimals));
    y.push_back(Rounded(p.y(), decimals));
    z.push_back(Rounded(p.z(), decimals));
  }
  return {{"x", x}, {"y", y}, {"z", z}};
}

Json PathJson(const Trajectory& trajectory, const Similarity& alignment) {
  Json path = {{"t", Json::array()}};
  std::vector<Eigen::Vector3d> points;
  for (const std::size_t k : Thinned(trajectory.size(), kMostPoses)) {
    path["t"].push_back(Rounded(trajectory[k].stamp_s - trajectory.front().stamp_s, 3));
    points.push_back(trajectory[k].pose.translation);
  }
  path.update(PointsJson(points, alignment, 4));
  return path;
}

Json ErrorJson(const RunResult& result, const Trajectory& estimate) {
  try {
    const EvaluationReport evaluation =
        EvaluateTrajectory(result.reference, estimate, EvaluationWith(result.rig.sensor == Sensor::kMono));
    std::vector<double> path;
    const std::vector<Pose>& reference = evaluation.poses.reference;
    for (std::size_t k = 0; k < evaluation.pairs; ++k)
      path.push_back(k == 0 ? 0
                            : path.back() + (reference[k].translation - reference[k - 1].translation).norm());
    Json distance = Json::array(), error = Json::array(), turn = Json::array();
    for (const std::size_t k : Thinned(evaluation.pairs, kMostErrors)) {
      distance.push_back(Rounded(path[k], 3));
      error.push_back(Rounded(evaluation.absolute.translation[k], 5));
      if (evaluation.rotations) turn.push_back(Rounded(evaluation.absolute.rotation_deg[k], 4));
    }
    Json relative_distance = Json::array(), relative = Json::array();
    for (const std::size_t k : Thinned(evaluation.relative.translation.size(), kMostErrors)) {
      relative_distance.push_back(Rounded(path[evaluation.relative_pairs[k].second], 3));
      relative.push_back(Rounded(evaluation.relative.translation[k], 5));
    }
    return {
        {"distance", distance},
        {"error", error},
        {"turn_deg", turn},
        {"rmse", evaluation.ate.rmse},
        {"relative", {{"distance", relative_distance}, {"error", relative}, {"rmse", evaluation.rpe.rmse}}}};
  } catch (const InputError&) {
    return Json();  // the summary says why
  }
}

// From trajectory.txt to what is drawn; the rotation as x, y, z, w.
Json AlignmentJson(const Similarity& alignment) {
  const Eigen::Quaterniond& q = alignment.rotation;
  const Eigen::Vector3d& t = alignment.translation;
  return {{"scale", alignment.scale},
          {"rotation", {q.x(), q.y(), q.z(), q.w()}},
          {"translation", {t.x(), t.y(), t.z()}}};
}

Json PointJson(const Eigen::Vector3d& p) { return {Rounded(p.x(), 4), Rounded(p.y(), 4), Rounded(p.z(), 4)}; }

Json EdgesJson(const std::vector<ShownLoop>& loops, const FramePlaces& places) {
  Json edges = Json::array();
  for (const ShownLoop& loop : loops) {
    const auto a = places.AtEnd(loop.candidate, loop.candidate_stamp_s),
               b = places.AtEnd(loop.query, loop.query_stamp_s);
    Json edge = {{"outcome", ToString(loop.outcome)},
                 {"query", loop.query},
                 {"candidate", loop.candidate},
                 {"h", Rounded(loop.hypothesis, 4)},
                 {"p", Rounded(loop.probability, 4)},
                 {"inliers", loop.inliers},
                 {"reason", loop.reason},
                 {"qt", Rounded(loop.query_stamp_s, 3)},
                 {"ct", Rounded(loop.candidate_stamp_s, 3)}};
    if (a && b) {
      edge["a"] = PointJson(*a);
      edge["b"] = PointJson(*b);
    }
    edges.push_back(std::move(edge));
  }
  return edges;
}

// Frames that were found in the map, where they are in the trajectory.
Json FoundJson(const RunResult& result, const FramePlaces& places) {
  Json found = Json::array();
  for (const FoundFrame& frame : result.found) {
    const auto p = places.At(frame.stamp_s);
    if (!p) continue;  // in another submap
    found.push_back({{"frame", frame.index}, {"by_loop", frame.by_loop}, {"p", PointJson(*p)}});
  }
  return found;
}

Json ScoreJson(const TrajectoryScore& score) {
  if (!score.valid) return {{"error", score.reason}};
  Json json = {{"ate_rmse_m", score.ate.rmse}, {"ate_max_m", score.ate.max}};
  if (score.rotations) {
    json["rotation_deg"] = score.ate_rotation.rmse;
    json["rpe_rmse_m"] = score.rpe.rmse;
  }
  if (score.kitti.segments > 0) {
    json["t_rel_percent"] = score.kitti.translation_percent;
    json["r_rel_deg_per_100m"] = 100 * score.kitti.rotation_deg_per_m;
  }
  return json;
}

Json FiguresJson(const RunResult& r) {
  Json json = {{"frames", r.frames_total},
               {"tracked", r.frames_tracked},
               {"lost", r.frames_lost},
               {"bad", r.bad.size()},
               {"without_depth", r.frames_without_depth},
               {"by_grey_values", r.frames_by_grey_values},
               {"keyframes", r.keyframes},
               {"proposed", r.loops.size()},
               {"accepted", r.LoopsAccepted()},
               {"corrections", r.corrections},
               {"wall_s", Rounded(r.wall_s, 2)},
               {"cpu_s", Rounded(r.cpu_s, 2)},
               {"latency_ms", Rounded(Quantile(r.latency_ms, 0.5), 2)},
               {"latency_p99_ms", Rounded(Quantile(r.latency_ms, 0.99), 2)},
               {"memory_mb", Rounded(r.peak_memory_mb, 1)}};
  if (r.lens) {
    json["lens"] = {{"k1", r.lens->k1},
                    {"k2", r.lens->k2},
                    {"k1_sigma", r.lens->k1_sigma},
                    {"k2_sigma", r.lens->k2_sigma},
                    {"steps", r.lens->steps.size()}};
  }
  if (r.imu)
    json["imu"] = {{"rate_hz", Rounded(r.imu->rate_hz, 0)},
                   {"used", r.imu->trusted},
                   {"findings", r.imu->findings.size()},
                   {"residual_deg", Rounded(r.imu->residual_deg, 4)},
                   {"time_offset_ms", Rounded(1000 * r.imu->time_offset_s, 2)},
                   {"up_sigma_deg", r.imu->up ? Json(Rounded(r.imu->up_sigma_deg, 3)) : Json()}};
  if (r.height)
    json["height"] = {{"measurements", r.height->measurements}, {"corrections", r.height->corrections}};
  if (r.evaluation) {
    json["true"] = r.evaluation->loops_true;
    json["false"] = r.evaluation->loops_false;
    json["path_m"] = Rounded(r.evaluation->path_m, 3);
    json["alignment"] = r.evaluation->alignment;
    json["odometry"] = ScoreJson(r.evaluation->odometry);
    json["slam"] = ScoreJson(r.evaluation->slam);
  }
  return json;
}

Json ThreeJson(const Eigen::Vector3d& v, int decimals) {
  return {Rounded(v.x(), decimals), Rounded(v.y(), decimals), Rounded(v.z(), decimals)};
}

// What an IMU's examination found, over the time since the first of what is compared.
Json ImuSeriesJson(const RunResult& result) {
  if (!result.imu) return Json();
  const ImuReport& imu = *result.imu;
  Json json = {{"findings", Json::array()},
               {"turns", Json::array()},
               {"moments", Json::array()},
               {"tilts", Json::array()},
               {"noise", Json()}};
  for (const ImuFinding& finding : imu.findings)
    json["findings"].push_back(finding.measured + "; " + finding.advice);
  const double begin = result.trajectory.empty() ? 0 : result.trajectory.front().stamp_s;
  for (const ImuTurn& turn : imu.turns)
    json["turns"].push_back({Rounded(turn.stamp_s - begin, 3), Rounded(turn.camera_deg_s, 2),
                             Rounded(turn.gyro_deg_s, 2), Rounded(turn.apart_deg, 4)});
  for (const ImuMoment& moment : imu.moments)
    json["moments"].push_back({{"t", Rounded(moment.stamp_s - begin, 2)},
                               {"bias", ThreeJson(moment.gyro_bias, 5)},
                               {"offset_ms", Rounded(1000 * moment.time_offset_s, 2)},
                               {"residual_deg", Rounded(moment.residual_deg, 4)}});
  for (const ImuTilt& tilt : imu.tilts) {
    const double cosine = imu.up ? std::clamp(tilt.up.dot(*imu.up), -1.0, 1.0) : 1;
    json["tilts"].push_back(
        {Rounded(tilt.stamp_s - begin, 2), Rounded(std::acos(cosine) * internal::kDegrees, 3)});
  }
  if (imu.noise)
    json["noise"] = {{"rest_s", imu.noise->rest_s},
                     {"tau_s", imu.noise->tau_s},
                     {"gyro", imu.noise->gyro},
                     {"acceleration", imu.noise->acceleration}};
  return json;
}

// Stages and frame times.
Json TimingJson(const RunResult& result) {
  Json stages = Json::array();
  for (const auto& [name, ms] : result.stage_ms) stages.push_back({{"name", name}, {"ms", Rounded(ms, 2)}});
  Json frames = Json::array();
  const std::size_t bins = std::min(kMostFrameTimes, result.frame_ms.size());
  std::vector<double> longest(bins, 0);
  for (std::size_t k = 0; k < result.frame_ms.size(); ++k) {
    double& bin = longest[k * bins / result.frame_ms.size()];
    bin = std::max(bin, result.frame_ms[k]);
  }
  for (const double ms : longest) frames.push_back(Rounded(ms, 2));
  return {{"stages", stages}, {"frame_ms", frames}, {"frames", result.frame_ms.size()}};
}

// Sections of the configuration, and what the program was built with.
Json ConfigurationJson(const RunResult& result) {
  Json sections = Json::array();
  for (const ConfigEntry& entry : DescribeConfig(result.config)) {
    if (sections.empty() || sections.back()["name"] != entry.section)
      sections.push_back({{"name", entry.section}, {"rows", Json::array()}});
    sections.back()["rows"].push_back({entry.name, entry.value, entry.doc});
  }
  return {{"file", result.config_file},
          {"dataset", result.dataset},
          {"seed", result.config.loops.seed},
          {"ground_truth", result.evaluation ? result.evaluation->file : ""},
          {"sections", sections},
          {"versions", BuildInfo()}};
}

Json ReportJson(const RunResult& result, const DetectionLog& log, const std::string& variant) {
  Similarity align_slam, align_odometry;
  const bool scored = result.evaluation && result.evaluation->slam.valid;
  if (scored) align_slam = align_odometry = result.evaluation->slam.alignment;
  if (scored && result.evaluation->odometry.valid) align_odometry = result.evaluation->odometry.alignment;
  const FramePlaces places(result, align_slam);
  const KnownLoops known = FindKnownLoops(result, log);
  const std::vector<ShownLoop> loops = ShownLoops(result, log, known);
  Json json;
  json["format"] = kReportFormat;
  json["variant"] = variant;
  json["dataset"] = result.dataset;
  json["seed"] = result.config.loops.seed;
  const bool has_metres = scored || (result.imu && result.imu->KnowsMetres());
  json["unit"] = result.rig.sensor == Sensor::kMono && !has_metres ? "map units" : "m";
  json["figures"] = FiguresJson(result);
  json["findings"] = Json::array();
  for (const CalibrationFinding& finding : result.calibration_findings)
    json["findings"].push_back(finding.measured + "; " + finding.advice);
  json["health"] = HealthJson(result);
  json["reference"] = scored ? PathJson(result.reference, {}) : Json();
  json["odometry"] = PathJson(result.trajectory_odometry, align_odometry);
  json["odometry_complete"] = result.odometry_complete;
  json["slam"] = PathJson(result.trajectory, align_slam);
  json["alignment"] = AlignmentJson(align_slam);
  json["earlier"] = Json::array();
  for (std::size_t k = 0; result.map && k < result.map->earlier.size(); ++k)
    json["earlier"].push_back(PathJson(result.map->earlier[k], align_slam));
  json["landmarks"] = PointsJson(log.landmarks(), align_slam, 3);
  json["found"] = FoundJson(result, places);
  json["loops"] = EdgesJson(loops, places);
  json["errors"] = {{"odometry", scored ? ErrorJson(result, result.trajectory_odometry) : Json()},
                    {"slam", scored ? ErrorJson(result, result.trajectory) : Json()}};
  json["precision_recall"] = PrecisionRecallJson(result, log, known);
  json["posterior"] = PosteriorJson(result, log, loops);
  json["gallery"] = GalleryJson(result, loops);
  json["timing"] = TimingJson(result);
  json["imu"] = ImuSeriesJson(result);
  json["configuration"] = ConfigurationJson(result);
  return json;
}

}  // namespace
}  // namespace report

std::string VariantName(const RunConfig& config) {
  if (!config.run.loops) return "odometry";
  if (config.loops.rule == CombinationRule::kJoint) return "ensemble";
  const bool standardised = config.loops.evidence.kind == EvidenceKind::kStandardised;
  return config.loops.rule == CombinationRule::kMean && standardised ? "standardised-mean"
                                                                     : RuleName(config.loops);
}

nlohmann::ordered_json RunReport(const RunResult& result, const DetectionLog& log,
                                 const std::string& variant) {
  return report::ReportJson(result, log, variant);
}

}  // namespace tutti
