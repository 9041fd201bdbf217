// `tutti run`: a data set in, trajectories, loops and a summary out.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/run/focal_length.h"
#include "apps/run/frame_clock.h"
#include "apps/run/given_odometry.h"
#include "apps/run/output_folder.h"
#include "apps/run/run_observer.h"
#include "apps/run/run_result.h"

namespace tutti {

/// What the command line can say.
struct RunRequest {
  std::filesystem::path config;   ///< YAML file
  std::filesystem::path dataset;  ///< folder, video file, or camera:0, camera:0,1
  std::string camera_source;      ///< where the camera comes from, for summary.json; empty: from `config`
  bool camera_guessed = false;    ///< nobody knows its focal length
  std::optional<FocalLength> focal_length;  ///< what was measured before the run, where nobody knew it
  std::filesystem::path out;                ///< folder for the results; made if it is not there
  std::optional<std::filesystem::path> ground_truth;  ///< "none": don't evaluate; default: the data set's own
  bool keep = false;  ///< number an earlier result in `out` instead of replacing it
  bool no_loops = false;
  bool no_imu = false;                ///< leave an IMU beside the images out
  std::optional<std::uint64_t> seed;  ///< of everything that draws numbers
  std::optional<int> threads;
  std::optional<int> inject_false_loops;  ///< instead of run.inject_false_loops
  std::optional<int> start, end, stride;  ///< instead of those of the section dataset [frames]
  std::optional<double> follow_s;         ///< DatasetOptions::follow_s
  std::optional<double> checkpoint_s;     ///< write OUT/checkpoint.tutti at most this often; none: never
  std::optional<std::filesystem::path> resume;    ///< checkpoint to go on from
  std::optional<std::filesystem::path> map;       ///< go on in this map, as another session
  std::optional<std::filesystem::path> save_map;  ///< write the map there; kMap: into `out`
  /// Follow this one instead of tracking; not with realtime, resume, map and checkpoint_s.
  std::optional<GivenOdometryFiles> odometry;
  bool realtime = false;                       ///< play by the time stamps, drop frames that it can't follow
  std::shared_ptr<FrameClock> clock;           ///< for realtime; null: the machine's
  bool timing = false;                         ///< measure every stage (RunResult::stages)
  std::optional<std::filesystem::path> trace;  ///< the same, and write a trace for Chrome or Perfetto there
  bool quiet = false;                          ///< no progress, no notes
  std::vector<std::shared_ptr<RunObserver>> observers;  ///< none null
  /// Files that go into `out` beside the run's own; names must be of those that a run writes. May be empty.
  std::function<std::vector<OutputFile>(const RunResult&)> more_files;
};

/// Runs and writes everything into request.out. Throws InputError for input that makes the run impossible,
/// and before the long work where it can be known: no configuration, no data, damaged ground truth, an output
/// folder that can't be written, holds what tutti did not write, or is in use. Bad frames are skipped and
/// counted. SIGINT, SIGTERM, SIGQUIT, SIGHUP, SIGXFSZ and SIGXCPU end it early, with everything written. So
/// does an exception (of an observer, for example), which is thrown on afterwards.
RunResult RunSlam(const RunRequest& request);

/// Runs with a configuration in memory; `request.config` is only a name then.
RunResult RunSlam(const RunRequest& request, const RunConfig& config);

/// A run that was broken off, as its checkpoint has it.
struct BrokenOffRun {
  RunRequest request;  ///< that RunSlam goes on with; all that it writes goes into `out`
  RunConfig config;
  /// Files elsewhere that the run was to write, and would again if it were told so; empty: none.
  std::string map, ltm_file;
};

/// The run whose checkpoint is in `out`. None if the run in `out` has finished. Throws InputError if there is
/// neither.
std::optional<BrokenOffRun> ResumeRequest(const std::filesystem::path& out);

/// What a run was called with, as its maps and checkpoints carry it (MapInfo::note). JSON: data set,
/// configuration's name, ground truth, and what else the configuration does not hold.
std::string NoteOf(const RunRequest& request);

/// What NoteOf made, but that a map which went elsewhere goes into the run's folder: a file that is read
/// names no file that is written. `elsewhere`: where it went; empty: it did not. Throws InputError, with the
/// name of the file, if it is something else.
RunRequest RequestOf(const std::string& note, const std::filesystem::path& file,
                     std::string* elsewhere = nullptr);

/// The data set that NoteOf was given; "" if the note is something else.
std::string DatasetOfNote(const std::string& note);

}  // namespace tutti
