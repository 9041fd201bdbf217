// Everything that a run found out; what summary.json, the tables and the plots are made from.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apps/run/focal_length.h"
#include "apps/run/map_figures.h"
#include "apps/run/timing.h"
#include "tutti/backend/evaluation.h"
#include "tutti/backend/keyframe_graph.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/calibration_check.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/config.h"
#include "tutti/slam/loop.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_system.h"

namespace tutti {

/// Frames in a row without a pose, and why.
struct LostStretch {
  std::int64_t first = 0, last = 0;  ///< InputFrame::index
  std::string state;                 ///< "initializing" or "lost"
  std::string reason;                ///< of its first frame
};

/// A frame that could not be read, or whose depth or right image could not.
struct BadFrame {
  std::int64_t index = 0;  ///< InputFrame::index
  std::string error;
};

/// Where a frame found its place in the map again.
struct FoundFrame {
  std::int64_t index = 0;  ///< InputFrame::index
  double stamp_s = 0;
  bool by_loop = false;  ///< a loop joined the recording with the map; else the loop detector knew the place
};

/// One trajectory against the reference.
struct TrajectoryScore {
  bool valid = false;
  std::string reason;            ///< why there is no score
  std::size_t poses = 0;         ///< pairs that were compared
  bool rotations = true;         ///< false: the reference has positions alone, the next three are unknown
  ErrorStatistics ate_rotation;  ///< [deg]
  ErrorStatistics rpe;           ///< from frame to frame [m]
  KittiErrors kitti;             ///< no segments if the path is shorter than 100 m
  ErrorStatistics ate;           ///< [m]
  double scale = 1;              ///< of the alignment (1 for SE(3))
  Similarity alignment;          ///< S_reference_estimate
};

/// Ground truth and what it says.
struct RunEvaluation {
  std::string file;       ///< of the ground truth
  std::string alignment;  ///< "se3" or "sim3"
  double path_m = 0;      ///< length of the reference over the run
  double extent_m = 0;    ///< of the reference: RMS distance from the middle of its positions
  TrajectoryScore odometry, slam;
  TrajectoryScore scaled;  ///< slam with a scale (Sim(3)), where it has one of its own: stereo and RGB-D
  int loops_true = 0, loops_false = 0, loops_unknown = 0;  ///< of the accepted ones
};

/// A loop as it lies in the world. NaN where it is not known.
struct LoopError {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  double distance_m = kUnknown;  ///< between the two poses: of the ground truth, else of trajectory.txt
  double angle_deg = kUnknown;   ///< between them
  double error_m = kUnknown;     ///< of the constraint against the ground truth
  double error_deg = kUnknown;
};

/// The map that a run went on in.
struct MapGoneOn {
  std::string file;
  std::vector<MapSession> sessions;  ///< the last one is the run's own
  /// T_world_body of the keyframes of each but the last, in the submap that trajectory.txt is of.
  std::vector<Trajectory> earlier;
  std::map<std::int64_t, Pose> keyframes;  ///< the same, by the numbers of their frames in the map
};

/// Frames, loops, times, trajectories of one run.
struct RunResult {
  // What was run.
  std::string dataset, config_file;
  std::string camera_source;    ///< RunRequest::camera_source
  bool camera_guessed = false;  ///< its focal length is one that cameras often have
  RunConfig config;
  CameraRig rig;

  std::vector<CalibrationFinding> calibration_findings;  ///< what can't be right about it

  // Frames.
  std::size_t frames_total = 0;          ///< that the run went through, bad and dropped ones included
  std::size_t frames_listed = 0;         ///< that the data set has
  std::size_t frames_tracked = 0;        ///< with a pose in trajectory.txt
  std::size_t frames_lost = 0;           ///< read, but without a pose when they came
  bool realtime = false;                 ///< played by the time stamps
  std::size_t frames_dropped = 0;        ///< not looked at, since newer ones were there already
  double skipped_share = 0;              ///< Dataset::SkippedShare
  std::size_t frames_without_mask = 0;   ///< where each image has a mask of its own: read, but without one
  std::size_t frames_without_depth = 0;  ///< stereo and RGB-D: read, but without a right or depth image
  std::vector<BadFrame> bad;
  std::vector<BadFrame> bad_depth;  ///< of those without depth the ones that have an image for it
  double frame_interval_s = 0;      ///< FrameInterval of the data set
  std::vector<LostStretch> lost;
  std::vector<FoundFrame> found;  ///< lost, or the first of the recording, and in the map by then
  std::size_t keyframes = 0;
  bool interrupted = false;
  std::optional<std::int64_t> resumed_from_frame;  ///< the checkpoint's next frame, if it went on from one
  bool endless = false;  ///< a camera, or a folder that grows: Ctrl-C is how it ends
  std::string failure;   ///< what broke the run off; empty: nothing did
  bool appearance_only = false;
  bool shared_odometry = false;  ///< tracked once for several runs; loops did not reach the tracking

  std::optional<MapGoneOn> map;  ///< with RunRequest::map
  bool in_map = false;           ///< `trajectory` is in that map's frame of reference: the run has joined it

  // Loops.
  std::vector<Loop> loops;             ///< frames by their numbers in the map (MapSession::frame_offset)
  std::vector<LoopError> loop_errors;  ///< of each, in their order; empty: not measured
  int corrections = 0;
  int global_adjustments = 0;

  // Trajectories: T_world_body, the world is the camera of the first keyframe.
  Trajectory trajectory, trajectory_odometry, keyframe_trajectory, reference;
  Trajectory trajectory_online;          ///< each pose as it was first given out, no loop had moved it yet
  std::vector<Trajectory> other_pieces;  ///< of the map, after losses; no loop joined them to `trajectory`
  bool odometry_complete =
      true;  ///< false: it ends at the first correction (interrupted, or run.odometry_pass: false)
  MapFigures map_figures;                          ///< zeros without poses
  std::optional<FocalLength> focal_length;         ///< RunRequest::focal_length
  std::optional<FocalLength> focal_length_of_map;  ///< what the whole map says then
  LensCheck lens_check;                            ///< not measured where another odometry is followed
  std::vector<int> frame_inliers;  ///< of each frame posed by landmarks, when it came: TrackResult::inliers
  std::size_t frames_by_grey_values = 0;  ///< posed without landmarks: TrackResult::by_grey_values
  bool given_odometry = false;            ///< another odometry was followed
  FollowedUncertainty followed;           ///< how uncertain it counts as
  PoseGraph graph;
  std::optional<KeyframeGraphProof> graph_proof;  ///< with graph.certify, if loops moved the map
  std::optional<RunEvaluation> evaluation;

  // Cost.
  double wall_s = 0;                ///< of the run, without the evaluation
  double cpu_s = 0;                 ///< processor time of all threads, without that of the odometry alone
  double odometry_alone_cpu_s = 0;  ///< processor time of the odometry that loops did not reach
  std::vector<double> frame_ms;     ///< of each frame, from having its features to having its pose
  std::vector<double>
      latency_ms;  ///< the same from having the image: without reading, and waiting in a queue
  std::map<std::string, double> stage_ms;  ///< summed over the run
  std::vector<StageTiming> stages;         ///< with RunRequest::timing or trace only
  double peak_memory_mb = 0;
  double stereo_row_error_px = 0, stereo_matches = 0;
  std::optional<LensFound> lens;           ///< mono, with self-calibration
  std::optional<ClocksFound> clocks;       ///< RGB-D
  std::optional<ClocksFound> clocks_used;  ///< measured, and put into config; standard deviation 0: not
  int begun_anew = 0;                      ///< so often, with what was measured of the clocks
  std::optional<HeightFound> height;       ///< mono, where the ground was seen
  std::optional<ImuReport> imu;            ///< of the IMU beside the images: by itself, then by them

  std::filesystem::path folder;  ///< where everything was written: RunRequest::out, or "unfinished" inside

  std::size_t LoopsAccepted() const { return CountAccepted(loops); }
  /// Lost frames whose place the loop detector knew.
  std::size_t FramesRelocalized() const {
    return static_cast<std::size_t>(
        std::count_if(found.begin(), found.end(), [](const FoundFrame& f) { return !f.by_loop; }));
  }
  /// False if it ended before its data set did.
  bool Finished() const { return failure.empty() && (!interrupted || endless); }
  /// True if the run is void: frames were there, calibration was there, and not one got a pose.
  bool Void() const { return !appearance_only && frames_tracked == 0; }
};

}  // namespace tutti
