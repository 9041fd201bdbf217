// Visual odometry: tracks a camera against a local map of keyframes and landmarks.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tutti/core/pose.h"
#include "tutti/core/span_recorder.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/global_adjustment.h"
#include "tutti/frontend/odometry_options.h"

#pragma GCC visibility push(default)
namespace tutti {

namespace internal {
class SectionReader;
}

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
  int keyframe = -1;              ///< id of the keyframe that this frame became, or -1; see TakeMapped
  std::optional<StepCheck> step;  ///< Follow, of a keyframe, if the images say enough
};

/// A keyframe's features as the loop closure and the pose graph see them. Frames of reference: the camera's.
struct KeyframeView {
  int id = -1;                   ///< grows by one with each keyframe
  std::int64_t frame_index = 0;  ///< index of the input frame
  double stamp_s = 0;
  int map_piece = 0;  ///< grows when tracking was lost and started again elsewhere
  Pose T_world_camera;
  std::vector<cv::KeyPoint> keypoints;  ///< size N
  cv::Mat descriptors;                  ///< N x 32, CV_8U (ORB)
  std::vector<Eigen::Vector3d> points;  ///< N points in the camera frame [m]; NaN where unknown
  std::vector<int> landmarks;           ///< N landmark ids, -1 where none
  std::vector<float> inverse_depth;     ///< N, measured by stereo or depth images [1/m]; 0 where they did not
  std::vector<float> inverse_depth_sigma;  ///< N, standard deviation of inverse_depth [1/m]
};

/// A point of the map. Frame of reference: the world of its map piece.
struct LandmarkView {
  int id = -1;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< [m]
  int observations = 0;                                ///< keyframes that see it, at least 1
};

/// Frames by their number (InputFrame::index, and the offset of BeginSession): of one recording, for example.
struct FrameRange {
  std::int64_t first = std::numeric_limits<std::int64_t>::min();
  std::int64_t last = std::numeric_limits<std::int64_t>::max();  ///< included
  bool Has(std::int64_t number) const { return number >= first && number <= last; }
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

/// Odometry of one camera rig. A value type: a copy goes on independently (the pipeline uses that to know
/// what the odometry alone would have done). Deterministic: the same frames give the same bits.
class Odometry {
 public:
  /// Throws InputError if options or rig are not usable (uncalibrated, no baseline for stereo, ...).
  Odometry(const OdometryOptions& options, const CameraRig& rig);
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

  /// From now on frames of another recording come, taken by this rig; sensor and image pyramid must be those
  /// of the map. They start a piece of the map of their own, unless RelocalizeAt finds one of the first of
  /// them in the map that is there. `frame_offset` is added to their InputFrame::index in all that this
  /// object tells: it should lead past every number that the map has. Time stamps may begin anew. Another
  /// camera than that of the frames so far (size, focal length, baseline) is carried over to: what the
  /// keyframes saw is in its pixels from then on, and its self-calibration begins anew. Throws InputError for
  /// another kind of sensor, or a focal length that is too different; this object is then as it was.
  void BeginSession(const CameraRig& rig, std::int64_t frame_offset);
  /// That is added to the InputFrame::index of the present recording; 0 without BeginSession.
  std::int64_t FrameOffset() const;
  /// Appends the map and the frames of another odometry, which stand apart as pieces of their own: its
  /// keyframes get ids after those that are there, its frame numbers this offset, its pieces numbers that are
  /// new. Its camera may be another one, as in BeginSession; throws InputError as that does. No frame may be
  /// tracked before the next BeginSession.
  void Append(const Odometry& other, std::int64_t frame_offset);
  /// Number of the map piece that the present recording started, or starts when it can: all pieces of before
  /// have smaller ones.
  int SessionPiece() const;

  /// From now on frames are located in the map that is there. The frames so far are forgotten, and the next
  /// one is lost until RelocalizeAt finds it. Time stamps may begin anew. The map stays as it is; where it
  /// shows too little of what is in view, keyframes are made for the time being. Frames without
  /// InputFrame::features get no more features than their pose needs. Beyond the map, RelocalizeAt may be
  /// called at any frame to find back from there.
  void BeginLocalization();
  /// True if, after BeginLocalization, too few of the map's landmarks agree with the last frame that has a
  /// pose: fewer than a lost frame is found again by.
  bool BeyondMap() const;
  /// Keyframe that shares most landmarks with the last frame that has a pose, after BeginLocalization one of
  /// the map unless BeyondMap(); -1 if there was none.
  int ReferenceKeyframe() const;
  /// Covariance of the pose of that frame given the map: position [m] in the world, then rotation [rad] about
  /// the camera's axes (T_world_camera Exp(tangent), to the first order). None if there was no such frame, or
  /// if its landmarks do not determine it.
  std::optional<Matrix6d> PoseCovariance() const;

  /// A new keyframe is mapped (landmarks, local bundle adjustment) beside the tracking of the next frames;
  /// what comes of it enters after OdometryOptions::mapping_delay_frames, whenever it is ready. Waits for
  /// what is under way and brings it in now; to be called after the last frame.
  void FinishMapping();
  /// Keyframes whose mapping has entered since the last call, oldest first: all their landmarks are known.
  std::vector<int> TakeMapped();
  /// false: mapping is done on the caller's thread, with the same result.
  void UseOwnThreads(bool own_threads);

  /// The landmarks that agree with the pose of the last frame that has one (of a keyframe also those that it
  /// made), in the order of its features. Costs a look at each feature.
  std::vector<SeenLandmark> SeenLandmarks() const;

  /// Ids of all keyframes that are in the map, ascending.
  std::vector<int> KeyframeIds() const;
  /// The id of the next keyframe: greater than those of all that are or were in the map.
  int NextKeyframeId() const;
  /// Everything about one keyframe, with the current map's points.
  KeyframeView Keyframe(int id) const;
  Pose KeyframePose(int id) const;
  int KeyframePiece(int id) const;
  std::int64_t KeyframeFrameIndex(int id) const;
  double KeyframeStamp(int id) const;

  /// Number of landmarks that are in the map.
  int LandmarkCount() const;
  /// The landmarks that are there now, ascending by id. A landmark that was merged into another one is that
  /// one.
  std::vector<LandmarkView> Landmarks() const;
  /// The rig that it was made for.
  const CameraRig& Rig() const;

  /// Pairs of keyframes (older id, newer id) that see at least `min_shared` common landmarks, with that
  /// number.
  std::vector<std::pair<std::pair<int, int>, int>> Covisibility(int min_shared) const;

  /// Moves keyframes to corrected poses S_world_camera (scale 1 for metric sensors); landmarks and the
  /// current pose go along with their keyframes, so that tracking goes on from the corrected place. `merges`:
  /// pieces whose keyframes are now in one frame of reference: piece -> the piece that it joined.
  void ApplyCorrection(const std::map<int, Similarity>& S_world_keyframe,
                       const std::map<int, int>& merges = {});

  /// After a loop moved the map: what the keyframes around `older` see is looked for in those around `newer`,
  /// where the loop says it must be, and landmarks that are the same become one. Returns how many landmarks
  /// both sides have in common then.
  int FuseLoop(int older, int newer, const Similarity& S_older_newer);

  /// What keyframes see of the same landmarks is looked for in all that should see it, and fused.
  void FuseAll();

  /// Removes keyframes that the map can do without, the newest first: at least 85 % of their landmarks are
  /// seen by three others, or from an earlier visit. What keyframes see of the same landmarks is found first,
  /// and fused. The first keyframe of each piece stays, and what the last frame hangs on. Frames
  /// hang on the keyframe that stands for theirs, and stay where they are. `may(removed, into)`, asked of
  /// each, can forbid it, and is asked again for other keyframes to stand for it. Returns which older
  /// keyframe stands for each that was removed; that one may be removed, too. Ids stay as they are. Throws
  /// InputError while frames are being located (BeginLocalization).
  std::map<int, int> RemoveRedundantKeyframes(const std::function<bool(int removed, int into)>& may);

  /// Begins to adjust all keyframes of a map piece and what they see (bundle adjustment) to each other,
  /// beside the tracking, with at most so many iterations. The oldest keyframe stays where it is.
  GlobalAdjustment BeginGlobalAdjustment(int map_piece, int iterations = 5) const;
  /// Waits for it. Where it moves the keyframes; those that came since follow. None if it found nothing
  /// better.
  std::optional<std::map<int, Similarity>> CorrectionOf(const GlobalAdjustment& adjustment) const;
  /// Moves keyframes to what CorrectionOf says, and landmarks to what the adjustment found.
  void Enter(const GlobalAdjustment& adjustment, const std::map<int, Similarity>& S_world_keyframe);

  /// Map pieces that have frames, by number of frames, most first (ties: the older one). Joined pieces are
  /// one.
  std::vector<int> Pieces(const FrameRange& range = {}) const;

  /// All posed frames so far, T_world_camera, in order of time, through their reference keyframes (so
  /// corrections and local bundle adjustment reach every frame). Only frames of `map_piece`; -1: of the piece
  /// with most frames.
  Trajectory FrameTrajectory(int map_piece = -1, const FrameRange& range = {}) const;
  /// Same length as FrameTrajectory(map_piece, range): number of the frame of each pose.
  std::vector<std::int64_t> FrameIndices(int map_piece = -1, const FrameRange& range = {}) const;

  /// Milliseconds spent so far, by stage ("extract", "track", "map", "local_ba", ...), summed.
  std::map<std::string, double> StageMilliseconds() const;
  /// Records each stage of each frame from now on; `recorder` must outlive this object and its copies, null
  /// ends it.
  void SetRecorder(SpanRecorder* recorder);
  /// Stereo: median row difference over matches [px] and matches of the median frame, so far (0 if not
  /// stereo).
  double StereoRowErrorPx() const;
  double StereoMatches() const;
  /// One camera: the lens by self-calibration, so far. None with depth, or with lens_sigma 0.
  std::optional<LensFound> Lens() const;
  /// One camera: how high it is above the ground. None: no ground was seen, or nobody looked for it.
  std::optional<HeightFound> Height() const;

  /// For files that hold more than an odometry (maps of tutti::slam): gives all that this object knows to
  /// `sink`, section by section; whether to use threads, and the recorder, belong to the object that loads
  /// it. Nothing is waited for: mapping that is under way begins again where it is loaded, with the same
  /// result. A copy can be saved on another thread while this object goes on, and destroyed there. The same
  /// state gives the same bytes, except those of the times that it took (tag 104).
  void SaveSections(const std::function<void(std::uint32_t tag, std::string_view bytes)>& sink) const;
  /// Takes up what SaveSections gave, from the next sections of a file, in place of all that this object
  /// knows; it then goes on exactly as the saved one would have, if the options are the same. Throws
  /// InputError for another rig, another image pyramid, or damage; the object is then as it was.
  void LoadSections(internal::SectionReader* file);
  /// What GlobalAdjustment::SaveSections gave, from the next section of a file. This must be the odometry
  /// that was saved with it. Throws InputError for damage.
  GlobalAdjustment LoadGlobalAdjustment(internal::SectionReader* file) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tutti
#pragma GCC visibility pop
