// Visual odometry: tracks a camera against a local map of keyframes and landmarks.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tutti/core/pose.h"
#include "tutti/core/span_recorder.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/global_adjustment.h"
#include "tutti/frontend/imu.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry_options.h"

#pragma GCC visibility push(default)
namespace tutti {

enum class TrackingState { kInitializing, kTracking, kLost };
const char* ToString(TrackingState state);

/// What the images say of a step that another odometry measured, from the keyframe before to a new one:
/// Exp(translation_m, rotation_rad) T_given = T_seen in the new keyframe's camera.
struct StepCheck {
  double way_m = 0;  ///< length of the step
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();
  double sigma_translation_m = 0;  ///< of what the images say, on its worst axis
  double sigma_rotation_rad = 0;   ///< the same
};

/// What became of one frame.
struct TrackResult {
  TrackingState state = TrackingState::kInitializing;
  std::string reason;             ///< why the frame has no pose (empty when it has one)
  Pose T_world_camera;            ///< valid if state == kTracking
  int features = 0;               ///< in the image
  int inliers = 0;                ///< landmarks that agree with the pose
  bool by_grey_values = false;    ///< no landmarks: in a blurred image, the grey values of the one before
  int keyframe = -1;              ///< id of the keyframe that this frame became, or -1
  bool recognised = false;        ///< it was lost, and got its pose because the loop detector knew its place
  std::optional<StepCheck> step;  ///< Follow, of a keyframe, if the images say enough
  /// Keyframes whose mapping has entered since the frame before, oldest first: all their landmarks are known.
  std::vector<int> mapped;
};

/// A landmark as a frame shows it.
struct SeenLandmark {
  int landmark = -1;  ///< its id; two landmarks that turn out to be one go on under one id
  cv::Point2f pixel;  ///< in the rectified image [px]
};

/// What one camera's images told of the radial distortion that its calibration left over: a pixel at offset d
/// from the principal point belongs at c + d (1 + k1 r^2 + k2 r^4), r^2 = (d_x / fx)^2 + (d_y / fy)^2.
struct LensFound {
  double k1 = 0, k2 = 0;              ///< [1]
  double k1_sigma = 0, k2_sigma = 0;  ///< standard deviations
  /// How it moved: features are corrected in steps that can be seen in the image.
  struct Step {
    std::int64_t frame_index = 0;  ///< InputFrame::index of the keyframe that told it
    double k1 = 0, k2 = 0;         ///< taken out of the features from then on
    double k1_sigma = 0, k2_sigma = 0;
  };
  std::vector<Step> steps;
};

/// What one camera's images told of its height above the ground (odometry.keep_height).
struct HeightFound {
  double height = 0;     ///< in the map's unit
  int measurements = 0;  ///< since the ground was found
  double agreeing = 0;   ///< share of the newest ones that found the ground at that height
  int corrections = 0;   ///< so often the scale of the newest keyframes was corrected by it
  double log_scale = 0;  ///< logarithm of all these corrections together
};

/// The last frame that has a pose, as the map explains it.
struct FrameView {
  int keyframe = -1;  ///< shares most landmarks with it; in Locating one of the map unless beyond_map; -1: no
                      ///< frame has a pose yet
  int newest_keyframe = -1;       ///< or the one at which the frame was found again
  std::int64_t frame_offset = 0;  ///< added to InputFrame::index of the present recording
  int session_piece = 0;  ///< submap that the present recording started, or starts when it can: all of
                          ///< before have smaller numbers
  /// In Locating: too few of the map's landmarks agree with it, fewer than a lost frame is found again by.
  bool beyond_map = false;
  /// Landmarks that agree with its pose (of a keyframe also those that it made), in the order of its
  /// features.
  std::vector<SeenLandmark> landmarks;
};

/// What the images of an RGB-D camera told of its clocks. Infinite standard deviations: it has not turned
/// enough, or the rig tells the readout.
struct ClocksFound {
  double readout_s = 0, readout_sigma_s = 0;          ///< CameraRig::readout_s, and its standard deviation
  double depth_delay_s = 0, depth_delay_sigma_s = 0;  ///< CameraRig::depth_delay_s
};

/// What an odometry found out beside poses, so far.
struct OdometryReport {
  std::map<std::string, double> stage_ms;  ///< milliseconds by stage ("extract", "track", "local_ba", ...)
  double stereo_row_error_px = 0;          ///< stereo: median row difference over matches [px]
  double stereo_matches = 0;               ///< stereo: matches of the median frame
  std::optional<ClocksFound> clocks;       ///< RGB-D
  std::optional<LensFound> lens;           ///< one camera, by self-calibration; none with lens_sigma 0
  std::optional<ImuReport> imu;            ///< what the images say of an IMU; none: it measured nothing
  std::optional<HeightFound>
      height;  ///< one camera above the ground; none: no ground was seen, or looked for
};

/// How an odometry works, which decides nothing but the time that it takes.
struct Execution {
  bool own_threads = true;  ///< false: mapping is done on the caller's thread
  /// Records each stage of each frame; must outlive the odometry and its copies. Null: nothing is recorded.
  SpanRecorder* recorder = nullptr;
};

/// How a map changes when loops are closed, in the order of the fields.
struct MapCorrection {
  /// Corrected poses (scale 1 for metric sensors) of the keyframes that move; landmarks and frames go along.
  std::map<int, Similarity> S_world_keyframe;
  std::map<int, int> merges =
      {};  ///< submap -> the submap that it joined, whose frame of reference is its own now
  /// Landmarks are where it found them, if there is one.
  std::shared_ptr<const GlobalAdjustment> adjustment = {};
  /// What the keyframes around both ends see becomes one, where the loop says that it is.
  struct Fusion {
    int older = -1, newer = -1;
    Similarity S_older_newer;
  };
  std::vector<Fusion> fused = {};
};

/// Makes an odometry that locates frames in a map.
struct Locating {};

/// Odometry of one camera rig: owns the map that it makes. A value type: a copy goes on independently (the
/// pipeline uses that to know what the odometry alone would have done). Deterministic: the same frames give
/// the same bits.
class Odometry {
 public:
  /// Throws InputError if options or rig are not usable (uncalibrated, no baseline for stereo, ...).
  Odometry(const OdometryOptions& options, const CameraRig& rig, const Execution& execution = {});
  /// Frames of another recording, by map.rig(), go on in a map: that of `before` or one that was made of it
  /// (WithRig, Append). They start a submap of their own, unless RelocalizeAt finds one of the first of them
  /// in the map. `frame_offset` is added to their InputFrame::index in all that this object tells: it should
  /// lead past every number that the map has. Time stamps may begin anew, and so does self-calibration of
  /// another camera than that of `before`.
  Odometry(const Odometry& before, Map map, std::int64_t frame_offset);
  /// Frames are located in the map of `before`, which stays as it is; where it shows too little of what is in
  /// view, keyframes are made for the time being. The next frame is lost until RelocalizeAt finds it. Frames
  /// without InputFrame::features get no more features than their pose needs. Beyond the map, RelocalizeAt
  /// may be called at any frame to find back from there. The map has no frames but those that are located.
  Odometry(const Odometry& before, Locating);
  Odometry(const Odometry& other, const Execution& execution);
  Odometry(const Odometry& other);
  Odometry& operator=(const Odometry& other);
  Odometry(Odometry&&) noexcept;
  Odometry& operator=(Odometry&&) noexcept;
  ~Odometry();

  /// Features of a frame, the part of Track that needs nothing from before: pure, safe on any thread. Put the
  /// result into InputFrame::features to take the work off Track's thread.
  std::shared_ptr<const FrameFeatures> Extract(const InputFrame& frame) const;

  /// Tracks the next frame; frames come in order of time. Never throws for hard images; throws InputError for
  /// those of another type or size than InputFrame and the rig say, as Extract and Follow do.
  TrackResult Track(const InputFrame& frame);

  /// The next frame of another odometry, which says where it is in that one's world: keyframes and landmarks
  /// are made at its poses, and none of them moves until somebody corrects the map. The map's frame of
  /// reference is that world at first; the frame after a correction goes on from where it moved. One camera's
  /// landmarks are triangulated between neighbouring keyframes, in the unit of the poses. Either all frames
  /// of an object come here or all to Track. Not lost, unless depth is awaited for the first keyframe. Throws
  /// InputError for a pose that is not finite.
  TrackResult Follow(const InputFrame& frame, const Pose& T_odom_camera);

  /// Tries the frame that Track has just lost (or could not start a map with) again, from a keyframe that
  /// shows the same place: tracking goes on from there if the map agrees. To be called before the next Track.
  /// Returns what Track did if that fails, or if there is no such frame.
  TrackResult RelocalizeAt(int keyframe);

  /// The map between two frames; mapping may be under way.
  const Map& map() const;

  /// A new keyframe is mapped (landmarks, local bundle adjustment) beside the tracking of the next frames;
  /// what comes of it enters after OdometryOptions::mapping_delay_frames, whenever it is ready. Waits for
  /// what is under way and brings it in now; to be called after the last frame. Returns the keyframes whose
  /// mapping has entered since the last frame (TrackResult::mapped).
  std::vector<int> FinishMapping();

  /// Changes the map, and goes on tracking from the corrected place. Returns for each fusion how many
  /// landmarks both sides have in common then.
  std::vector<int> Correct(const MapCorrection& correction);

  /// Goes on in this map: its own of after FinishMapping, where keyframes but those of LastView may have been
  /// removed (Prune) and landmarks fused (FuseAll).
  void Replace(Map map);

  FrameView LastView() const;
  OdometryReport Report() const;

 private:
  class Impl;
  friend std::optional<Matrix6d> PoseCovariance(const Odometry& odometry);
  friend GlobalAdjustment AdjustGlobally(const Odometry& odometry, int map_piece, int iterations);
  friend class OdometryFile;
  std::unique_ptr<Impl> impl_;
};

/// Covariance of the pose of the last frame that has one, given the map: position [m] in the world, then
/// rotation [rad] about the camera's axes (T_world_camera Exp(tangent), to the first order). None if there is
/// no such frame, or if its landmarks do not determine it.
std::optional<Matrix6d> PoseCovariance(const Odometry& odometry);

/// Begins to adjust all keyframes of a submap and what they see (bundle adjustment) to each other, beside the
/// tracking, with at most so many iterations. The oldest keyframe stays where it is.
GlobalAdjustment AdjustGlobally(const Odometry& odometry, int map_piece, int iterations = 5);

}  // namespace tutti
#pragma GCC visibility pop
