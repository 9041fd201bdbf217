#include "apps/run/localization.h"

#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <utility>

#include "apps/plot/plot.h"
#include "apps/run/interrupt.h"
#include "apps/run/output_folder.h"
#include "apps/run/prefetcher.h"
#include "apps/run/progress.h"
#include "apps/run/run_parts.h"
#include "apps/slam/map_state.h"
#include "core/numbers.h"
#include "core/replaced_file.h"
#include "core/stopwatch.h"
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/slam/localizer.h"
#include "tutti/slam/slam_system.h"
#include "tutti/slam/version.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSummary = "summary.json";
constexpr const char* kFrames = "localization.csv";
constexpr const char* kTrajectory = "trajectory.txt";
constexpr const char* kPicture = "localization.svg";

bool IsLocalization(const fs::path& entry) {
  const std::string name = entry.filename();
  return name == kSummary || name == kFrames || name == kTrajectory || name == kPicture;
}

DatasetOptions Reading(const LocalizationRequest& request, const MapInfo& info) {
  DatasetOptions options = request.options.value_or(ForAnotherRecording(info.config.dataset));
  if (request.mask) options.mask = request.mask->string();
  if (request.start) options.start = *request.start;
  if (request.end) options.end = *request.end;
  if (request.stride) options.stride = *request.stride;
  return options;
}

void CheckRig(const LocalizationRequest& request, const CameraRig& map, const CameraRig& data) {
  if (StateOf(map.camera) == StateOf(data.camera) && map.sensor == data.sensor &&
      map.baseline_m == data.baseline_m && map.readout_s == data.readout_s &&
      map.depth_delay_s == data.depth_delay_s)
    return;
  char text[200];
  std::snprintf(text, sizeof text, "%s, %dx%d px, fx %.2f px in the map, %s, %dx%d px, fx %.2f px",
                WordOf(map.sensor), map.camera.width, map.camera.height, map.camera.fx, WordOf(data.sensor),
                data.camera.width, data.camera.height, data.camera.fx);
  throw InputError(request.dataset.string() + ": has another camera than the map " + request.map.string() +
                   " (" + text + "); for now both must be the same");
}

std::string FramesCsv(const Localization& localization) {
  std::string csv =
      "frame,stamp_s,state,recognised,keyframe,inliers,position_sigma_m,rotation_sigma_deg,reason\n";
  for (const LocalizedFrame& frame : localization.frames) {
    const bool posed = frame.track.state == TrackingState::kTracking;
    char line[256];
    std::snprintf(line, sizeof line, "%lld,%.6f,%s,%d,%d,%d,", static_cast<long long>(frame.index),
                  frame.stamp_s,
                  !posed         ? "lost"
                  : frame.beyond ? "beyond"
                                 : "localized",
                  frame.recognised ? 1 : 0, frame.keyframe, frame.track.inliers);
    csv += line;
    std::snprintf(line, sizeof line, ",");
    if (frame.covariance)
      std::snprintf(line, sizeof line, "%.6g,%.6g",
                    std::sqrt(frame.covariance->topLeftCorner<3, 3>().trace()),
                    std::sqrt(frame.covariance->bottomRightCorner<3, 3>().trace()) / internal::kRadians);
    csv += line + (",\"" + frame.track.reason) + "\"\n";
  }
  return csv;
}

std::string Summary(const LocalizationRequest& request, const Localization& l) {
  nlohmann::ordered_json json;
  json["version"] = kVersion;
  json["command"] = "localize";
  json["map"] = request.map.string();
  json["dataset"] = request.dataset.string();
  json["interrupted"] = l.interrupted;
  json["finished"] = !l.interrupted;
  json["frames"] = {{"total", l.frames.size() + l.bad},
                    {"localized", l.Localized()},
                    {"lost", l.frames.size() - l.Localized()},
                    {"bad", l.bad}};
  if (l.masked) json["frames"]["without_mask"] = l.without_mask;
  json["time"] = {{"load_s", l.load_s}, {"wall_s", l.wall_s}, {"cpu_s", l.cpu_s}};
  if (l.first_pose_s) json["time"]["first_pose_s"] = *l.first_pose_s;
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

// The map's keyframes from above, by recording.
std::vector<PlotSeries> MapSeries(const RunState& state) {
  const std::size_t count = state.sessions.size();
  std::vector<PlotSeries> series(count);
  for (std::size_t k = 0; k < count; ++k)
    series[k] = {"session " + std::to_string(k + 1), {}, SessionColor(k), 2.5, false};
  if (count == 1) series[0] = {"map", {}, "#999999", 2.5, false};
  std::vector<int> pieces(count, -1);
  for (const int id : state.odometry->map().KeyframeIds()) {
    if (id >= state.end_of_map) break;
    const std::size_t session = state.SessionOf(state.odometry->map().keyframe(id).frame_index);
    std::vector<Eigen::Vector3d>& points = series[session].points;
    const int piece = state.odometry->map().keyframe(id).piece;
    if (std::exchange(pieces[session], piece) != piece) points.emplace_back(Eigen::Vector3d::Constant(NAN));
    points.push_back(state.odometry->map().keyframe(id).T_world_camera.translation);
  }
  return series;
}

// The map, and where the frames are in it.
TrajectoryPlot Picture(const LocalizationRequest& request, const RunState& state, const Localization& l) {
  TrajectoryPlot plot;
  plot.title = "Frames of " + request.dataset.filename().string() + " in " + request.map.filename().string();
  plot.unit = state.odometry->map().rig().sensor == Sensor::kMono ? "initial scale" : "m";
  PlotSeries located{"localized", {}, "#0072b2", 1.8, false},
      beyond{"beyond the map", {}, "#d55e00", 1.2, true};
  const Eigen::Vector3d gap = Eigen::Vector3d::Constant(NAN);
  for (const LocalizedFrame& frame : l.frames) {
    const bool posed = frame.track.state == TrackingState::kTracking;
    const Eigen::Vector3d at = posed ? frame.track.T_world_camera.translation : gap;
    located.points.push_back(posed && !frame.beyond ? at : gap);
    beyond.points.push_back(posed && frame.beyond ? at : gap);
    if (frame.recognised) plot.marks.push_back(at);
  }
  plot.marks_name = "recognised (" + std::to_string(plot.marks.size()) + ")";
  plot.series = MapSeries(state);
  plot.series.push_back(std::move(located));
  plot.series.push_back(std::move(beyond));
  return plot;
}

RunState StateIn(const SlamSystem& slam, const Localizer& localizer) {
  RunState state = {&localizer.odometry(), slam.loops()};
  state.sessions.clear();
  for (const MapSession& session : slam.Sessions()) state.sessions.push_back(session.frame_offset);
  state.end_of_map = localizer.map_keyframes();
  return state;
}

void LocateAll(const LocalizationRequest& request, const Dataset& dataset, const internal::Stopwatch& since,
               const SlamSystem& slam, Localizer& localizer, Localization& result) {
  PrefetchOptions reading;
  reading.end = dataset.Size();
  reading.ahead = request.threads > 1 ? 4 : 0;
  reading.stop = &InterruptGuard::Requested;
  Prefetcher frames(dataset, reading);
  Progress progress("localize", dataset.Size(), request.quiet ? nullptr : internal::StandardError());
  const Pose T_camera_body = dataset.Rig().T_body_camera.Inverse();
  RunState state = StateIn(slam, localizer);
  const bool endless = dataset.FrameSupply() != Supply::kStored;
  for (const auto& observer : request.observers)
    observer->OnStart(dataset.Rig(), endless ? 0 : dataset.Size());
  for (std::size_t i = 0; !InterruptGuard::Requested(); ++i) {
    const std::optional<FetchedFrame> fetched = frames.Next();
    if (!fetched) break;
    if (!fetched->read.frame) {
      ++result.bad;
      progress.Note("tutti: frame " + std::to_string(dataset.Number(fetched->position)) +
                        " is skipped: " + fetched->read.error,
                    "frames are skipped");
      continue;
    }
    const InputFrame& frame = *fetched->read.frame;
    if (frame.mask.empty()) ++result.without_mask;
    LocalizedFrame located;
    located.index = frame.index;
    located.stamp_s = frame.stamp_s;
    located.track = localizer.Track(frame);
    state.recognised = located.track.recognised;
    for (const auto& observer : request.observers) observer->OnFrame(frame, located.track, state);
    if (located.track.state == TrackingState::kTracking) {
      located.recognised = state.recognised;
      const FrameView view = localizer.odometry().LastView();
      located.beyond = view.beyond_map;
      if (!located.beyond) located.keyframe = view.keyframe;
      located.covariance = PoseCovariance(localizer.odometry());
      result.trajectory.push_back({frame.stamp_s, located.track.T_world_camera * T_camera_body});
      if (!result.first_pose_s) result.first_pose_s = since.Seconds();
    }
    result.frames.push_back(std::move(located));
    progress.Update(i + 1, std::to_string(result.Localized()) + " localized");
  }
  for (const auto& observer : request.observers) observer->OnEnd(state);
  progress.Finish();
  result.interrupted = InterruptGuard::Requested();
}

}  // namespace

Localization Localize(const LocalizationRequest& request) {
  const internal::Stopwatch since;
  cv::setNumThreads(1);
  const OutputLayout layout = {IsLocalization, kSummary, "version", {}, nullptr};
  OutputFolder::Check(request.out, layout);
  MapInfo info = ReadMapInfo(request.map);
  const DatasetOptions options = Reading(request, info);
  const std::unique_ptr<Dataset> dataset = OpenDataset(request.dataset, options);
  CheckRig(request, info.rig, dataset->Rig());
  const InterruptGuard guard;
  RefuseToReplace(request.out, request.map);
  OutputFolder folder(request.out, layout);
  Localization result;
  result.masked = !options.mask.empty();
  info.config.run.threads = request.threads;
  const std::unique_ptr<SlamSystem> slam = LoadMap(request.map, info);
  Localizer localizer(*slam);
  result.load_s = since.Seconds();
  result.map_keyframes = localizer.map_keyframes();
  const internal::Stopwatch watch;
  const double cpu = ProcessCpuSeconds();
  LocateAll(request, *dataset, since, *slam, localizer, result);
  result.wall_s = watch.Seconds();
  result.cpu_s = ProcessCpuSeconds() - cpu;
  const TrajectoryFormat tum = TrajectoryFormat::kTum;
  const RunState state = StateIn(*slam, localizer);
  folder.Write({kTrajectory, [&](const fs::path& file) { WriteTrajectory(file, result.trajectory, tum); }});
  folder.Write({kFrames, [&](const fs::path& file) { internal::WriteFile(file, FramesCsv(result)); }});
  folder.Write({kPicture, [&](const fs::path& file) { WriteSvg(file, Picture(request, state, result)); }});
  folder.Write(
      {kSummary, [&](const fs::path& file) { internal::WriteFile(file, Summary(request, result)); }});
  ThrowFailures(folder.failures(), folder.Finish(!result.interrupted));
  return result;
}

}  // namespace tutti
