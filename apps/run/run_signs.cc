#include "apps/run/run_signs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string_view>

#include "core/numbers.h"
#include "core/terminal.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

using Value = std::optional<double>;

constexpr int kFewInliers = 30;
constexpr int kEnoughKeyframes = 6;         // of which a map says something
constexpr std::ptrdiff_t kMostRefused = 2;  // verified loops that did not enter the map
constexpr double kSigmas = 2;               // that a focal length may be off
constexpr std::size_t kNeighbours = 7;      // steps on either side of one
constexpr double kStill = 0.002;            // of the scene's depth: images move by about a pixel
constexpr double kReferenceOff = 0.02;      // that a ground truth may be off [m]

bool HasMap(const RunResult& r) {
  return !r.given_odometry && !r.Void() && r.map_figures.keyframes >= kEnoughKeyframes;
}

Value If(bool known, double value) { return known ? Value(value) : std::nullopt; }

bool IsMono(const RunResult& r) { return r.rig.sensor == Sensor::kMono; }

Value Share(double part, double whole) { return whole > 0 ? Value(part / whole) : std::nullopt; }

double FramesRead(const RunResult& r) {
  return static_cast<double>(r.frames_total - r.bad.size() - r.frames_dropped);
}

Value ShareOfLargestPiece(const RunResult& r) {
  auto all = static_cast<double>(r.frames_tracked);
  for (const Trajectory& piece : r.other_pieces) all += static_cast<double>(piece.size());
  return Share(static_cast<double>(r.frames_tracked), all);
}

Value FewInliers(const RunResult& r) {
  const auto few = std::count_if(r.frame_inliers.begin(), r.frame_inliers.end(),
                                 [](int inliers) { return inliers < kFewInliers; });
  return Share(static_cast<double>(few), static_cast<double>(r.frame_inliers.size()));
}

// The median depth of the keyframes' landmarks; 0: not known.
double SceneDepth(const RunResult& r) {
  std::vector<double> depths;
  for (const auto& [frame, depth] : r.map_figures.depth) depths.push_back(depth);
  return depths.empty() ? 0 : internal::Median(std::move(depths));
}

// A camera that stands still moves by what its poses are off: that is no speed to compare with.
Value SpeedJump(const RunResult& r) {
  if (r.given_odometry) return std::nullopt;
  const double still = kStill * SceneDepth(r);
  std::vector<double> speeds, times;
  for (std::size_t i = 1; i < r.trajectory.size(); ++i) {
    const double time = r.trajectory[i].stamp_s - r.trajectory[i - 1].stamp_s;
    const double way = (r.trajectory[i].pose.translation - r.trajectory[i - 1].pose.translation).norm();
    if (!(time > 0)) continue;
    speeds.push_back(way / time);
    times.push_back(time);
  }
  if (speeds.size() < kNeighbours) return std::nullopt;
  const double usual = internal::Median(speeds);
  if (!(usual > 0)) return std::nullopt;
  double jump = 1;
  for (std::size_t i = 0; i < speeds.size(); ++i) {
    const std::size_t begin = i < kNeighbours ? 0 : i - kNeighbours;
    const std::size_t end = std::min(speeds.size(), i + kNeighbours + 1);
    const double around =
        internal::Median(std::vector<double>(speeds.begin() + static_cast<std::ptrdiff_t>(begin),
                                             speeds.begin() + static_cast<std::ptrdiff_t>(end)));
    jump = std::max(jump, speeds[i] / std::max({around, 0.5 * usual, still / times[i]}));
  }
  return jump;
}

Value FocalLengthOff(const RunResult& r) {
  if (!HasMap(r) || !r.lens_check.measured) return std::nullopt;
  return std::max(0.0, std::abs(std::log(r.lens_check.focal_ratio)) - kSigmas * r.lens_check.sigma);
}

Value ClocksOff(const RunResult& r) {
  if (!r.clocks) return std::nullopt;
  const auto off = [](double value, double sigma) { return std::max(0.0, std::abs(value) - 3 * sigma); };
  return 1e3 * std::max(off(r.clocks->readout_s, r.clocks->readout_sigma_s),
                        off(r.clocks->depth_delay_s - r.rig.depth_delay_s, r.clocks->depth_delay_sigma_s));
}

// At the middle of the image's left or right edge.
Value LensOff(const RunResult& r) {
  if (!HasMap(r)) return std::nullopt;
  const double edge = 0.5 * r.rig.camera.width / r.rig.camera.fx;
  const double found = r.lens ? r.lens->k1 + r.lens->k2 * edge * edge : 0.0;
  const double checked = r.lens_check.measured || r.lens_check.other_lens ? r.lens_check.k1 : 0.0;
  return std::max(std::abs(found), std::abs(checked)) * edge * edge;
}

Value LoopsRefused(const RunResult& r) {
  // What is younger is in the local map, and was never to enter. Without keyframes there is no constraint
  // (two views of one camera too far apart for a scale), which says nothing of the map.
  const auto recognised = [&](const Loop& loop) {
    return loop.verified && !loop.injected && loop.edge.candidate >= 0 &&
           loop.query_stamp_s - loop.candidate_stamp_s >= r.config.run.loop_min_age_s;
  };
  const auto all = std::count_if(r.loops.begin(), r.loops.end(), recognised);
  const auto refused = std::count_if(r.loops.begin(), r.loops.end(),
                                     [&](const Loop& loop) { return recognised(loop) && !loop.accepted(); });
  if (refused <= kMostRefused) return 0;
  return Share(static_cast<double>(refused), static_cast<double>(all));
}

Value DamagedImages(const RunResult& r) {
  const Value bad =
      Share(static_cast<double>(r.bad.size()), static_cast<double>(r.frames_total - r.frames_dropped));
  return 1 - (1 - bad.value_or(0)) * (1 - r.skipped_share);
}

// Beyond what the ground truth itself may be off, as share of a length.
Value ErrorOver(const RunResult& r, double RunEvaluation::*length_m) {
  if (!r.evaluation || !r.evaluation->slam.valid) return std::nullopt;
  return Share(std::max(0.0, r.evaluation->slam.ate.rmse - kReferenceOff), *r.evaluation.*length_m);
}

// At least: a scale is known as well as the positions that it is from.
Value ScaleOff(const RunResult& r) {
  if (!r.evaluation || !r.evaluation->scaled.valid || !(r.evaluation->extent_m > 0)) return std::nullopt;
  const TrajectoryScore& scaled = r.evaluation->scaled;
  if (!(scaled.scale > 0)) return std::nullopt;
  const double uncertain = std::max(scaled.ate.rmse, kReferenceOff) / r.evaluation->extent_m;
  return std::exp(std::max(0.0, std::abs(std::log(scaled.scale)) - uncertain));
}

std::string Shown(const RunSign& sign) {
  const std::string_view unit = sign.kind->unit;
  char text[40];
  if (unit == "share") {
    std::snprintf(text, sizeof text, "%.1f %%", 100 * sign.value);
  } else {
    std::snprintf(text, sizeof text, unit == "1" ? "%.0f" : "%.2f", sign.value);
  }
  return text;
}

// Most frames have no pose: what one image shows is not in the next.
bool ShowsNoFilm(const RunResult& result, const RunHealth& health) {
  std::error_code ignored;
  const bool no_photos = result.rig.sensor != Sensor::kMono || result.dataset.empty() ||
                         IsCamera(result.dataset) ||
                         std::filesystem::is_regular_file(result.dataset, ignored);  // a video, a bag
  if (health.word != HealthWord::kFailed || no_photos || result.given_odometry) return false;
  return std::any_of(health.signs.begin(), health.signs.end(), [](const RunSign& sign) {
    return sign.kind->name == std::string_view("frames_posed") && sign.kind->IsFailed(sign.value);
  });
}

std::string Sentence(const RunSign& sign) {
  std::string text = sign.kind->says;
  const std::size_t place = text.find("%s");
  if (place != std::string::npos) text.replace(place, 2, Shown(sign));
  return text + "; " + sign.kind->advice;
}

}  // namespace

const std::vector<SignKind>& SignKinds() {
  constexpr double kNever = SignKind::kNever;
  constexpr bool kAbove = true, kBelow = false;
  static const std::vector<SignKind> kinds = {
      {"frames_posed", "share", "frames with a pose in trajectory.txt, of those that could be read", kBelow,
       0.95, 0.5, "only %s of the frames have a pose in trajectory.txt",
       "frames.lost_stretches in summary.json says where and why; slower motion, more light or more frames a "
       "second help",
       [](const RunResult& r) { return Share(static_cast<double>(r.frames_tracked), FramesRead(r)); }},
      {"largest_piece", "share", "poses in trajectory.txt, of those in all submaps", kBelow, 0.95, 0.5,
       "the map consists of several submaps: only %s of the poses are in trajectory.txt",
       "the others are in trajectory_piece_1.txt, ...; a view of a known place joins them",
       ShareOfLargestPiece},
      {"damaged_images", "share",
       "images of the recording that can't be used: damaged, or with a time stamp that an earlier one has",
       kAbove, 0.05, 0.5, "%s of the images are damaged or repeat a time stamp, and were skipped",
       "frames.bad_frames in summary.json and the notes at the start of the run say which; record or copy "
       "them again",
       DamagedImages},
      {"dropped_frames", "share", "in real time: frames that the run was too slow for", kAbove, 0.25, kNever,
       "%s of the frames were dropped, since the run could not follow",
       "a lower odometry.features, smaller images or another machine follow; without --realtime every frame "
       "counts",
       [](const RunResult& r) {
         return r.realtime ? Share(double(r.frames_dropped), double(r.frames_total)) : std::nullopt;
       }},
      {"without_depth", "share", "stereo and depth images: frames that came without a right or depth image",
       kAbove, 0.25, kNever, "%s of the frames came without a right or depth image",
       "frames.bad_depth in summary.json and the notes at the start of the run say which and why",
       [](const RunResult& r) {
         return IsMono(r) ? std::nullopt : Share(double(r.frames_without_depth), FramesRead(r));
       }},
      {"few_inliers", "share", "frames with a pose by landmarks, of which fewer than 30 agree with it",
       kAbove, 0.25, 0.5, "%s of the poses rest on fewer than 30 landmarks",
       "dark, blurred or bare images; raise odometry.features, or slow down", FewInliers},
      {"speed_jump", "factor", "greatest step between two frames over those around it, by their times",
       kAbove, 4, kNever, "the trajectory jumps: one step is %s times those around it",
       "look at trajectory.svg there; frames may be missing", SpeedJump},
      {"odometry_jumps", "1", "given odometry: steps that no motion explains (a wrong pose, a restart)",
       kAbove, 0, kNever, "the given odometry has jumps: %s",
       "given_odometry.jumps in summary.json says when; wrong poses were replaced by those between their "
       "neighbours, other jumps have no weight",
       [](const RunResult& r) { return If(r.given_odometry, double(r.followed.jumps.size())); }},
      {"scale_jump", "factor",
       "one camera: greatest factor by which depths and speed changed together between three keyframes and "
       "the next three",
       kAbove, 2, kNever, "the scale jumps: depths and speed change together by a factor of %s",
       "one camera can't see its scale; a loop, stereo or depth can",
       [](const RunResult& r) { return If(HasMap(r) && IsMono(r), r.map_figures.scale_jump); }},
      {"local_scale", "factor",
       "stereo and depth images: depth of the landmarks over what keyframes measure, over five keyframes in "
       "a "
       "row, the farthest from 1, either way",
       kAbove, 1.05, kNever,
       "the scale is locally off: landmarks and measured depths differ by a factor of %s",
       "look at the stretch where depth is scarce or wrong; check baseline or depth scale, and focal length",
       [](const RunResult& r) {
         return If(HasMap(r) && !IsMono(r), std::exp(std::abs(std::log(r.map_figures.local_scale))));
       }},
      {"landmarks", "1", "landmarks that a keyframe sees, median", kBelow, 40, 10,
       "the map is thin: a keyframe sees %s landmarks", "bare or dark images; raise odometry.features",
       [](const RunResult& r) { return If(HasMap(r), r.map_figures.landmarks); }},
      {"without_parallax", "share",
       "one camera: keyframes whose landmarks are seen under less than 1 deg from the others", kAbove, 0.5,
       kNever, "the camera turns more than it moves: %s of the keyframes have no parallax",
       "move sideways while turning",
       [](const RunResult& r) { return If(HasMap(r) && IsMono(r), r.map_figures.without_parallax); }},
      {"misfit", "px", "reprojection error of landmarks that three keyframes see, median", kAbove, 1.5,
       kNever, "landmarks are %s px off where keyframes see them, in the median",
       "check the camera: focal length, distortion, rolling shutter; tutti calibrate-check",
       [](const RunResult& r) { return If(HasMap(r), r.map_figures.misfit_px); }},
      {"depth_misfit", "share",
       "stereo and depth images: how far landmarks that three keyframes see are from where one of them "
       "measures them, of their depth, median",
       kAbove, 0.08, kNever,
       "landmarks are %s of their depth off where keyframes measure them, in the median",
       "check focal length and baseline or depth scale, and that images and depth are of the same time",
       [](const RunResult& r) { return If(HasMap(r) && !IsMono(r), r.map_figures.depth_misfit); }},
      {"focal_length_off", "share",
       "how far, at least, the focal length that fits the map best is from the given one (less 2 standard "
       "deviations)",
       kAbove, 0.005, kNever, "the map fits another focal length better, at least %s away",
       "check fx and fy; without --config and --camera tutti run measures them, and "
       "focal_length.better_camera in summary.json is what the whole map says then",
       FocalLengthOff},
      {"lens_off", "share",
       "radial distortion that the calibration left over, at the middle of the image's side edge", kAbove,
       0.03, kNever, "the lens bends the image by %s at its edge, beyond what the calibration says",
       "check the distortion's model and coefficients", LensOff},
      {"clocks_off", "ms",
       "depth cameras: how far, at least, readout or depth's delay are from what the run took them to be "
       "(less "
       "3 standard deviations)",
       kAbove, 6, kNever, "rows, or depth, are at least %s ms off the time that they are taken to be of",
       "set camera.readout_s and camera.depth_delay_s to what clocks in summary.json says", ClocksOff},
      {"loops_refused", "share", "loops that were recognised and contradict the map, if there are 3", kAbove,
       0.5, kNever, "the map contradicts %s of the loops that were recognised",
       "its shape or scale may be wrong; loops.csv says why each was refused", LoopsRefused},
      {"calibration_findings", "1", "findings of tutti calibrate-check", kAbove, 0, kNever,
       "the calibration can't be right: findings: %s", "calibration_findings in summary.json says what to do",
       [](const RunResult& r) { return Value(r.calibration_findings.size()); }},
      {"imu_findings", "1", "what speaks against the IMU beside the images", kAbove, 0, kNever,
       "the IMU was left out, since it contradicts itself or the images: findings: %s",
       "imu.findings in summary.json says what to do; the run is what it would be without",
       [](const RunResult& r) { return r.imu ? Value(r.imu->findings.size()) : std::nullopt; }},
      {"error_of_path", "share", "with ground truth: ATE beyond 2 cm, of the path's length", kAbove, 0.05,
       0.15, "the ground truth says that positions are off by %s of the path",
       "the table above has the figures; check camera, depth scale and time stamps",
       [](const RunResult& r) { return ErrorOver(r, &RunEvaluation::path_m); }},
      {"error_of_extent", "share",
       "with ground truth: ATE beyond 2 cm, of how far positions are from their middle (RMS)", kAbove, 0.25,
       0.75, "the ground truth says that positions are off by %s of the trajectory's extent",
       "its shape is another one; look at trajectory.svg",
       [](const RunResult& r) { return ErrorOver(r, &RunEvaluation::extent_m); }},
      {"scale_off", "factor",
       "stereo and depth images, with ground truth: factor, at least, between the scale of the trajectory "
       "and that of the ground truth",
       kAbove, 1.05, 1.5, "the ground truth says that the scale is off by a factor of %s at least",
       "check the depth scale (--set dataset.depth_units_per_m=1000 for millimetres), the baseline or the "
       "focal length",
       ScaleOff},
      {"camera_guessed", "1", "1: nobody calibrated the camera, and its focal length could not be measured",
       kAbove, 0, kNever, "the camera is not calibrated, its focal length is a guess",
       "turns and lengths can be wrong by tens of percent; give --camera, --fov or --calibration",
       [](const RunResult& r) { return Value(r.camera_guessed ? 1 : 0); }},
  };
  return kinds;
}

std::vector<RunSign> SignsOf(const RunResult& result) {
  std::vector<RunSign> signs;
  if (result.appearance_only) return signs;
  for (const SignKind& kind : SignKinds()) {
    const Value value = kind.measure(result);
    if (value && std::isfinite(*value)) signs.push_back({&kind, *value});
  }
  return signs;
}

const char* ToString(HealthWord word) {
  return word == HealthWord::kGood ? "good" : word == HealthWord::kDoubtful ? "doubtful" : "failed";
}

std::optional<RunHealth> HealthOf(const RunResult& result) {
  if (result.appearance_only) return std::nullopt;
  RunHealth health;
  health.signs = SignsOf(result);
  for (const RunSign& sign : health.signs) {
    HealthWord word = HealthWord::kGood;
    if (sign.kind->IsDoubtful(sign.value)) word = HealthWord::kDoubtful;
    if (sign.kind->IsFailed(sign.value)) word = HealthWord::kFailed;
    if (word == HealthWord::kGood) continue;
    health.reasons.push_back(Sentence(sign));
    health.word = std::max(health.word, word);
  }
  if (result.Void() && health.word != HealthWord::kFailed) {  // nothing to take a share of
    health.word = HealthWord::kFailed;
    health.reasons.push_back("no frame could be read; frames.bad_frames in summary.json says why");
  }
  if (ShowsNoFilm(result, health))
    health.reasons.push_back("are these separate photos, and no film? `tutti loops " + result.dataset +
                             "` finds those that show the same place, without poses");
  return health;
}

std::string HealthText(const RunResult& result) {
  const std::optional<RunHealth> health = HealthOf(result);
  if (!health) return "";
  const std::string word = ToString(health->word);
  if (health->word == HealthWord::kGood)
    return "\n  " + word + ": nothing that the run shows speaks against its result\n";
  std::string text = "\n  " + word + ":\n";
  for (const std::string& reason : health->reasons) text += "    * " + internal::Printable(reason) + "\n";
  return text;
}

}  // namespace tutti
