// summary.json, loops.csv and the table on the terminal.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>

#include "apps/run/graph_json.h"
#include "apps/run/outputs.h"
#include "apps/run/run_parts.h"
#include "apps/run/run_signs.h"
#include "core/numbers.h"
#include "tutti/slam/version.h"

namespace tutti {
namespace {

using Json = nlohmann::ordered_json;

// A value of the configuration as JSON: numbers and booleans as such, the rest as text.
Json ConfigValue(const std::string& text) {
  const Json parsed = Json::parse(text, nullptr, false);
  return parsed.is_discarded() ? Json(text) : parsed;
}

Json ScoreJson(const TrajectoryScore& score) {
  if (!score.valid) return Json{{"error", score.reason}};
  Json json = {{"ate_rmse_m", score.ate.rmse},
               {"ate_mean_m", score.ate.mean},
               {"ate_median_m", score.ate.median},
               {"ate_std_m", score.ate.std},
               {"ate_min_m", score.ate.min},
               {"ate_max_m", score.ate.max},
               {"ate_rotation_rmse_deg", score.rotations ? Json(score.ate_rotation.rmse) : Json()},
               {"rpe_rmse_m", score.rotations ? Json(score.rpe.rmse) : Json()},
               {"poses", score.poses},
               {"scale", score.scale}};
  if (score.kitti.segments > 0) {
    json["kitti_translation_percent"] = score.kitti.translation_percent;
    json["kitti_rotation_deg_per_m"] = score.kitti.rotation_deg_per_m;
  }
  return json;
}

// Only what --timing or --trace measured.
Json StagesJson(const RunResult& r) {
  Json rows = Json::array();
  for (const StageTiming& stage : r.stages) {
    rows.push_back({{"lane", ToString(stage.lane)},
                    {"name", stage.name},
                    {"calls", stage.calls},
                    {"median_ms", stage.median_ms},
                    {"p99_ms", stage.p99_ms},
                    {"total_ms", stage.total_ms},
                    {"cpu_ms", stage.cpu_ms >= 0 ? Json(stage.cpu_ms) : Json()},
                    {"share", stage.share}});
  }
  return rows;
}

Json LoopsJson(const RunResult& r) {
  Json loops = {{"proposed", r.loops.size()},
                {"accepted", r.LoopsAccepted()},
                {"corrections", r.corrections},
                {"global_adjustments", r.global_adjustments}};
  int injected = 0, injected_accepted = 0;
  loops["doubted"] = Json::array();
  for (const Loop& loop : r.loops) {
    injected += loop.injected ? 1 : 0;
    injected_accepted += loop.injected && loop.accepted() ? 1 : 0;
    const bool believed = r.appearance_only || loop.weight >= 0.5;  // without poses there is no graph
    if (!loop.verified || (loop.accepted() && believed)) continue;
    loops["doubted"].push_back(
        {{"query", loop.query},
         {"candidate", loop.candidate},
         {"weight", loop.weight},
         {"reason", loop.accepted() ? "down-weighted by the robust loss" : loop.reason},
         {"injected", loop.injected}});
  }
  loops["injected"] = injected;
  loops["injected_accepted"] = injected_accepted;
  if (r.evaluation) {
    loops["true"] = r.evaluation->loops_true;
    loops["false"] = r.evaluation->loops_false;
    loops["without_ground_truth"] = r.evaluation->loops_unknown;
  }
  return loops;
}

Json FramesJson(const RunResult& r) {
  Json frames = {{"total", r.frames_total},
                 {"tracked", r.frames_tracked},
                 {"bad", r.bad.size()},
                 {"lost", r.frames_lost},
                 {"relocalized", r.FramesRelocalized()},
                 {"dropped", r.frames_dropped},
                 {"in_dataset", r.frames_listed},
                 {"without_mask", r.frames_without_mask},
                 {"without_depth", r.frames_without_depth},
                 {"by_grey_values", r.frames_by_grey_values}};
  for (const auto& [name, list] : {std::pair("bad_frames", &r.bad), {"bad_depth", &r.bad_depth}}) {
    frames[name] = Json::array();
    for (const BadFrame& bad : *list) frames[name].push_back({{"index", bad.index}, {"error", bad.error}});
  }
  frames["lost_stretches"] = Json::array();
  for (const LostStretch& lost : r.lost) {
    frames["lost_stretches"].push_back(
        {{"first", lost.first}, {"last", lost.last}, {"state", lost.state}, {"reason", lost.reason}});
  }
  frames["other_pieces"] = Json::array();
  for (const Trajectory& piece : r.other_pieces) {
    frames["other_pieces"].push_back({{"frames", piece.size()},
                                      {"first_stamp_s", piece.front().stamp_s},
                                      {"last_stamp_s", piece.back().stamp_s}});
  }
  return frames;
}

// What graph.certify has found.
Json GraphJson(const RunResult& r) {
  if (!r.graph_proof) return {{"certificate", {{"available", false}, {"reason", "no loop moved the map"}}}};
  const KeyframeGraphProof& proof = *r.graph_proof;
  return {{"start", ToString(proof.best)},
          {"moved", proof.better},
          {"starts", StartsJson(proof.starts)},
          {"certificate", CertificateJson(proof.certificate)}};
}

// What the images say of the clocks of an RGB-D camera; `used`: the run was made with it.
Json ClocksJson(const RunResult& r) {
  Json json = Json::object();
  const auto put = [&](const char* name, double ClocksFound::*value, double ClocksFound::*sigma) {
    const bool used = r.clocks_used && (*r.clocks_used).*sigma > 0;
    const std::optional<ClocksFound>& from = used ? r.clocks_used : r.clocks;
    if (from && std::isfinite((*from).*sigma))
      json[name] = {{"value", (*from).*value}, {"sigma", (*from).*sigma}, {"used", used}};
  };
  put("readout_s", &ClocksFound::readout_s, &ClocksFound::readout_sigma_s);
  put("depth_delay_s", &ClocksFound::depth_delay_s, &ClocksFound::depth_delay_sigma_s);
  return json;
}

// What an IMU shows by itself, and what the images say of it.
Json ImuJson(const ImuReport& imu) {
  Json json = {{"measurements", imu.samples},
               {"rate_hz", imu.rate_hz},
               {"duration_s", imu.duration_s},
               {"missing_share", imu.missing_share},
               {"longest_gap_s", imu.longest_gap_s},
               {"acceleration_mps2", imu.acceleration_mps2},
               {"used", imu.trusted},
               {"findings", Json::array()}};
  for (const ImuFinding& finding : imu.findings)
    json["findings"].push_back({{"measured", finding.measured}, {"advice", finding.advice}});
  if (!(imu.agreement > 0)) return json;
  const auto vector = [](const auto& v) { return Json{v.x(), v.y(), v.z()}; };
  json["images_say"] = {{"steps", imu.steps},
                        {"turned_deg", imu.turned_deg},
                        {"agreement", imu.agreement},
                        {"residual_deg", imu.residual_deg},
                        {"time_offset_s", imu.time_offset_s},
                        {"time_offset_sigma_s", imu.time_offset_sigma_s},
                        {"gyro_bias_rad_s", vector(imu.gyro_bias)},
                        {"mounting_sigma_deg", imu.mounting_sigma_deg}};
  if (imu.R_camera_imu) {
    Json q = vector(*imu.R_camera_imu);
    q.push_back(imu.R_camera_imu->w());
    json["images_say"]["R_camera_imu_xyzw"] = q;
  }
  if (imu.up)
    json["gravity"] = {{"mps2", imu.gravity_mps2},
                       {"up", vector(*imu.up)},
                       {"up_sigma_deg", imu.up_sigma_deg},
                       {"acceleration_bias_mps2", vector(imu.acceleration_bias)}};
  if (imu.metres > 0)
    json["gravity"].update({{"map_unit_m", imu.metres}, {"map_unit_sigma", imu.metres_sigma}});
  return json;
}

// What self-calibration says of the lens.
Json LensJson(const LensFound& lens) {
  Json json = {{"k1", lens.k1},
               {"k2", lens.k2},
               {"k1_sigma", lens.k1_sigma},
               {"k2_sigma", lens.k2_sigma},
               {"steps", Json::array()}};
  for (const LensFound::Step& step : lens.steps) {
    json["steps"].push_back({{"frame", step.frame_index},
                             {"k1", step.k1},
                             {"k2", step.k2},
                             {"k1_sigma", step.k1_sigma},
                             {"k2_sigma", step.k2_sigma}});
  }
  return json;
}

// The map that the run went on in.
Json MapJson(const RunResult& r) {
  const MapSession& own = r.map->sessions.back();
  Json json = {{"file", r.map->file},
               {"joined", r.in_map},
               {"joined_at_frame", own.joined_at ? Json(*own.joined_at) : Json()},
               {"frame_offset", own.frame_offset},
               {"sessions", Json::array()}};
  for (const MapSession& session : r.map->sessions) {
    json["sessions"].push_back({{"dataset", &session == &own ? r.dataset : DatasetOfNote(session.note)},
                                {"frame_offset", session.frame_offset},
                                {"frames", session.frames},
                                {"keyframes", session.keyframes},
                                {"first_keyframe", session.first_keyframe},
                                {"last_keyframe", session.last_keyframe}});
  }
  return json;
}

std::string Quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

// These columns are always there, since scripts rely on them; further members follow.
constexpr const char* kMembers[] = {"surf", "sift", "orb"};

double MemberPosterior(const Loop& loop, const std::string& name) {
  for (const MemberOpinion& member : loop.members) {
    if (member.name == name) return member.took_part ? member.hypothesis : std::nan("");
  }
  return std::nan("");
}

// Empty for what is not finite.
std::string Cell(double value, int decimals, const char* suffix = "") {
  if (!std::isfinite(value)) return "";
  char text[80];
  std::snprintf(text, sizeof text, "%.*f%s", decimals, value, suffix);
  return text;
}

// One row of the terminal's table.
std::string Row(const std::string& name, const std::string& a, const std::string& b, const std::string& c) {
  char text[200];
  std::snprintf(text, sizeof text, "  %-22s %14s %14s %14s\n", name.c_str(), a.c_str(), b.c_str(), c.c_str());
  return text;
}

std::string Improvement(double before, double after) {
  if (!(before > 0) || !(after > 0)) return "";
  if (std::abs(after - before) < 0.005 * before) return "none";
  if (after > before) return Cell(after / before, 2, "x, worse");
  return Cell(before / after, 2, "x better");
}

// What --camera takes, for the images as they are stored; empty: what the run had is as good.
std::string BetterCamera(const RunResult& r) {
  constexpr double kSame = 0.005, kSurer = 0.7;
  if (!r.focal_length || !r.focal_length_of_map || !r.focal_length_of_map->measured) return "";
  const FocalLength &before = *r.focal_length, &map = *r.focal_length_of_map;
  const double change = map.camera.fx / r.rig.camera.fx;
  if (std::abs(change - 1) < kSame || (before.measured && map.sigma > kSurer * before.sigma)) return "";
  PinholeCamera camera = before.camera;
  camera.fx *= change;
  camera.fy *= change;
  char text[160];
  int length =
      std::snprintf(text, sizeof text, "%.1f,%.1f,%.1f,%.1f", camera.fx, camera.fy, camera.cx, camera.cy);
  if (camera.distortion == Distortion::kRadTan)
    std::snprintf(text + length, sizeof text - static_cast<std::size_t>(length), ",%.4f,0,0,0",
                  camera.coefficients[0]);
  return text;
}

Json FocalLengthJson(const RunResult& r) {
  const auto json = [](const std::optional<FocalLength>& f) {
    if (!f) return Json();
    return Json{{"measured", f->measured}, {"px", f->camera.fx}, {"sigma", f->sigma}, {"reason", f->reason}};
  };
  return {{"first_frames", json(r.focal_length)},
          {"map", json(r.focal_length_of_map)},
          {"better_camera", BetterCamera(r)}};
}

}  // namespace

Json HealthJson(const RunResult& r) {
  const std::optional<RunHealth> health = HealthOf(r);
  if (!health) return Json();
  Json signs = Json::object();
  for (const RunSign& sign : health->signs) signs[sign.kind->name] = sign.value;
  return {{"word", ToString(health->word)}, {"reasons", health->reasons}, {"signs", signs}};
}

std::string SummaryJson(const RunResult& r) {
  Json json;
  json["version"] = kVersion;
  json["dataset"] = r.dataset;
  json["config_file"] = r.config_file;
  if (!r.camera_source.empty()) json["camera_source"] = r.camera_source;
  json["sensor"] = WordOf(r.rig.sensor);
  json["seed"] = r.config.loops.seed;
  json["realtime"] = r.realtime;
  json["interrupted"] = r.interrupted;
  if (r.resumed_from_frame) json["resumed_from_frame"] = *r.resumed_from_frame;
  if (r.map) json["map"] = MapJson(r);
  json["finished"] = r.Finished();
  if (!r.failure.empty()) json["failure"] = r.failure;
  json["appearance_only"] = r.appearance_only;
  json["shared_odometry"] = r.shared_odometry;
  json["frames"] = FramesJson(r);
  json["calibration_findings"] = Json::array();
  for (const CalibrationFinding& f : r.calibration_findings)
    json["calibration_findings"].push_back({{"measured", f.measured}, {"advice", f.advice}});
  json["health"] = HealthJson(r);
  json["keyframes"] = r.keyframes;
  json["loops"] = LoopsJson(r);
  if (r.config.run.certify) json["graph"] = GraphJson(r);
  const double focal_length_cpu_s = (r.focal_length ? r.focal_length->cpu_s : 0.0) +
                                    (r.focal_length_of_map ? r.focal_length_of_map->cpu_s : 0.0);
  Json stages = Json::object();
  for (const auto& [name, ms] : r.stage_ms) stages[name] = ms;
  json["timing"] = {
      {"wall_s", r.wall_s},
      {"cpu_s", r.cpu_s},
      {"focal_length_cpu_s", focal_length_cpu_s},
      {"odometry_alone_cpu_s", r.odometry_alone_cpu_s},
      {"frame_ms", {{"median", Quantile(r.frame_ms, 0.5)}, {"p99", Quantile(r.frame_ms, 0.99)}}},
      {"latency_ms", {{"median", Quantile(r.latency_ms, 0.5)}, {"p99", Quantile(r.latency_ms, 0.99)}}},
      {"stage_ms", stages}};
  if (!r.stages.empty()) json["timing"]["stages"] = StagesJson(r);
  json["memory"] = {{"peak_mb", r.peak_memory_mb}};
  if (r.rig.sensor == Sensor::kStereo) {
    json["stereo"] = {{"row_error_px", r.stereo_row_error_px}, {"matches", r.stereo_matches}};
  }
  if (r.given_odometry && !r.appearance_only) {
    const auto sigmas = [](double fraction, double rotation_rad) {
      return Json{{"fraction", fraction}, {"rotation_deg", rotation_rad * internal::kDegrees}};
    };
    json["given_odometry"] = {{"stated", sigmas(r.followed.stated_fraction, r.followed.stated_rotation_rad)},
                              {"seen", sigmas(r.followed.seen_fraction, r.followed.seen_rotation_rad)},
                              {"jumps", Json::array()}};
    for (const OdometryJump& jump : r.followed.jumps) {
      json["given_odometry"]["jumps"].push_back(
          {{"from_s", std::isfinite(jump.from_s) ? Json(jump.from_s) : Json()},
           {"to_s", std::isfinite(jump.to_s) ? Json(jump.to_s) : Json()},
           {"distance_m", jump.distance_m},
           {"angle_deg", jump.angle_rad * internal::kDegrees},
           {"comes_back", jump.comes_back}});
    }
  }
  if (!r.given_odometry && !r.appearance_only)
    json["lens_check"] = {{"measured", r.lens_check.measured},
                          {"focal_ratio", r.lens_check.focal_ratio},
                          {"sigma", r.lens_check.sigma},
                          {"k1", r.lens_check.k1},
                          {"other_lens", r.lens_check.other_lens}};
  if (r.focal_length) json["focal_length"] = FocalLengthJson(r);
  if (r.lens) json["lens"] = LensJson(*r.lens);
  if (r.clocks || r.clocks_used) json["clocks"] = ClocksJson(r);
  if (r.imu) json["imu"] = ImuJson(*r.imu);
  if (r.height)
    json["height"] = {{"height", r.height->height},
                      {"measurements", r.height->measurements},
                      {"agreeing", r.height->agreeing},
                      {"corrections", r.height->corrections},
                      {"log_scale", r.height->log_scale}};
  if (r.evaluation) {
    json["evaluation"] = {
        {"alignment", r.evaluation->alignment},  {"ground_truth", r.evaluation->file},
        {"path_m", r.evaluation->path_m},        {"odometry", ScoreJson(r.evaluation->odometry)},
        {"slam", ScoreJson(r.evaluation->slam)}, {"odometry_complete", r.odometry_complete}};
    if (r.evaluation->scaled.valid) json["evaluation"]["sim3_scale"] = r.evaluation->scaled.scale;
  }
  Json config = Json::object();
  for (const ConfigEntry& entry : DescribeConfig(r.config)) {
    const std::size_t dot = entry.section.find('.');
    Json& section = config[entry.section.substr(0, dot)];
    Json& place = dot == std::string::npos ? section : section[entry.section.substr(dot + 1)];
    place[entry.name] = ConfigValue(entry.value);
  }
  json["config"] = config;
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::vector<std::string> OtherMembers(const std::vector<std::string>& members) {
  std::vector<std::string> others;
  for (const std::string& name : members) {
    if (std::find(std::begin(kMembers), std::end(kMembers), name) != std::end(kMembers)) continue;
    if (std::find(others.begin(), others.end(), name) == others.end()) others.push_back(name);
  }
  return others;
}

std::string LoopsCsvHeader(const std::vector<std::string>& members) {
  std::string line =
      "query,candidate,query_stamp_s,candidate_stamp_s,surf,sift,orb,ensemble,inliers,matches,accepted,"
      "reason,verified,tx,ty,tz,qx,qy,qz,qw,scale,sigmas,weight,injected,probability,distance_m,angle_deg,"
      "error_m,error_deg,correct,witness";
  for (const std::string& name : members) line += "," + name;
  return line + "\n";
}

std::string LoopsCsvLine(const Loop& loop, const std::vector<std::string>& members, const LoopError& error) {
  std::ostringstream out;
  out << loop.query << ',' << loop.candidate << ',' << Cell(loop.query_stamp_s, 9) << ','
      << Cell(loop.candidate_stamp_s, 9);
  for (const char* name : kMembers) out << ',' << Cell(MemberPosterior(loop, name), 6);
  out << ',' << Cell(loop.hypothesis, 6) << ',' << loop.inliers << ',' << loop.matches << ','
      << (loop.accepted() ? 1 : 0) << ',' << Quoted(loop.reason) << ',' << (loop.verified ? 1 : 0);
  if (loop.S_candidate_query) {
    const Similarity& s = *loop.S_candidate_query;
    for (const double v : {s.translation.x(), s.translation.y(), s.translation.z(), s.rotation.x(),
                           s.rotation.y(), s.rotation.z(), s.rotation.w(), s.scale}) {
      out << ',' << Cell(v, 9);
    }
  } else {
    out << ",,,,,,,,";
  }
  out << ',' << (loop.gate_sigmas ? Cell(*loop.gate_sigmas, 6) : "");
  out << ',' << Cell(loop.weight, 6) << ',' << (loop.injected ? 1 : 0);
  out << ',' << Cell(loop.probability, 6);
  for (const double v : {error.distance_m, error.angle_deg, error.error_m, error.error_deg})
    out << ',' << Cell(v, 4);
  out << ',' << (loop.correct ? (*loop.correct ? "1" : "0") : "");
  out << ',' << (loop.witness.empty() ? "" : Quoted(loop.witness));
  for (const std::string& name : members) out << ',' << Cell(MemberPosterior(loop, name), 6);
  out << '\n';
  return out.str();
}

std::string LoopsCsv(const RunResult& r) {
  std::vector<std::string> names;
  for (const Loop& loop : r.loops) {
    for (const MemberOpinion& member : loop.members) names.push_back(member.name);
  }
  names = OtherMembers(names);
  std::string text = LoopsCsvHeader(names);
  for (std::size_t i = 0; i < r.loops.size(); ++i)
    text += LoopsCsvLine(r.loops[i], names, i < r.loop_errors.size() ? r.loop_errors[i] : LoopError());
  return text;
}

std::string ResultTable(const RunResult& r) {
  std::ostringstream out;
  out << "\n  frames " << r.frames_tracked << " of " << r.frames_total << " tracked";
  if (!r.bad.empty()) out << ", " << r.bad.size() << " bad";
  if (r.frames_without_mask > 0) out << ", " << r.frames_without_mask << " without mask";
  if (r.frames_without_depth > 0)
    out << ", " << r.frames_without_depth << " without " << DepthSource(r.rig.sensor) << " image";
  if (r.frames_by_grey_values > 0) out << ", " << r.frames_by_grey_values << " by grey values alone";
  if (r.realtime) out << ", " << r.frames_dropped << " dropped";
  out << "; keyframes " << r.keyframes << "; loops " << r.LoopsAccepted() << " accepted of " << r.loops.size()
      << " proposed";
  if (r.evaluation)
    out << " (" << r.evaluation->loops_true << " true, " << r.evaluation->loops_false << " false)";
  out << "\n  time " << Cell(r.wall_s, 1, " s");
  if (r.frames_total > 0 && r.wall_s > 0) {
    const auto frames = static_cast<double>(r.frames_total);
    out << ", " << Cell(frames / r.wall_s, 1, " frames/s") << ", " << Cell(1000 * r.cpu_s / frames, 1)
        << " ms of processor time per frame; a pose " << Cell(Quantile(r.latency_ms, 0.5), 1)
        << " ms after its image (p99 " << Cell(Quantile(r.latency_ms, 0.99), 1) << " ms)";
  }
  out << "; memory " << Cell(r.peak_memory_mb, 0, " MB") << "\n";
  if (const std::string camera = BetterCamera(r); !camera.empty())
    out << "  the whole map says a focal length of " << Cell(r.focal_length_of_map->camera.fx, 1, " px")
        << ", give or take " << Cell(100 * r.focal_length_of_map->sigma, 1)
        << " %, and is surer than the first frames; for a run with it add\n    --camera " << camera << "\n";
  if (r.imu && r.imu->trusted) {
    out << "  the IMU agrees with the images to " << Cell(r.imu->residual_deg, 3)
        << " deg from frame to frame, its clock is off by " << Cell(1000 * r.imu->time_offset_s, 1) << " ms";
    if (r.imu->up) out << "; the world's z axis points up, to " << Cell(r.imu->up_sigma_deg, 2) << " deg";
    if (r.imu->KnowsMetres())
      out << "; its unit is the metre, to " << Cell(100 * r.imu->metres_sigma, 1) << " %";
    out << "\n";
  }
  if (r.given_odometry && !r.appearance_only && r.LoopsAccepted() > 0 && r.corrections == 0 &&
      r.global_adjustments == 0)
    out << "  all loops agree with the given trajectory within their own uncertainty: it is not changed\n";
  if (r.map && r.in_map) {
    out << "  in the map " << r.map->file;
    if (r.map->sessions.back().joined_at) out << " from frame " << *r.map->sessions.back().joined_at << " on";
    out << ": trajectory.txt is in its frame of reference\n";
  } else if (r.map) {
    out << "  not joined with the map " << r.map->file
        << ": no loop connects the two; trajectory.txt has a frame of reference of its own\n";
  }
  if (!r.evaluation) return out.str();
  const TrajectoryScore &a = r.evaluation->odometry, &b = r.evaluation->slam;
  if (!a.valid && !b.valid) {
    out << "  no evaluation: " << b.reason << "\n";
    return out.str();
  }
  out << "\n" << Row("ATE, " + r.evaluation->alignment, "odometry alone", "with ensemble", "change");
  const auto line = [&](const char* name, double ErrorStatistics::*field) {
    out << Row(name, a.valid ? Cell(a.ate.*field, 4, " m") : "-", b.valid ? Cell(b.ate.*field, 4, " m") : "-",
               a.valid && b.valid ? Improvement(a.ate.*field, b.ate.*field) : "");
  };
  line("rmse", &ErrorStatistics::rmse);
  line("median", &ErrorStatistics::median);
  line("max", &ErrorStatistics::max);
  if (r.evaluation->path_m > 0) {
    const auto share = [&](const TrajectoryScore& s) {
      return s.valid ? Cell(100 * s.ate.rmse / r.evaluation->path_m, 3, " %") : "-";
    };
    out << Row("rmse / path of " + Cell(r.evaluation->path_m, 1, " m"), share(a), share(b), "");
  }
  return out.str();
}

}  // namespace tutti
