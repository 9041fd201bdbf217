// The map: keyframes, landmarks, who sees what, and where every frame was. A value type; copies share what is
// the same in both. What is done to a map are functions, a file each, in frontend/map.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"
#include "tutti/core/shared_vector.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/landmark.h"

#pragma GCC visibility push(default)
namespace tutti {

namespace internal {
class SectionReader;
}

/// A frame that stays in the map.
struct Keyframe {
  int id = -1;                   ///< grows by one with each keyframe
  int replaced_by = -1;          ///< older keyframe that stands for it since it was removed; -1: it is there
  std::int64_t frame_index = 0;  ///< number of the input frame
  double stamp_s = 0;
  int piece = 0;  ///< submap: grows when tracking was lost and started again elsewhere
  Pose T_world_camera;
  std::shared_ptr<const FrameFeatures> features;  ///< see ViewOf
  std::vector<int> landmarks;                     ///< per feature: landmark id or -1
  std::map<int, int> covisible;                   ///< other keyframe -> number of common landmarks

  /// Defined in frontend/store/features_state.h.
  template <class Archive>
  void State(Archive& archive);
};

/// A frame that has a pose. It hangs on a keyframe: corrections of the map reach all frames.
struct MapFrame {
  std::int64_t index = 0;  ///< number of the input frame
  double stamp_s = 0;
  int keyframe = -1;
  Pose T_keyframe_frame;
  int before =
      -1;  ///< that the frame before hangs on, if it is another and the camera was tracked from there
  Pose T_before_frame;  ///< what the map said when the frame came; all that tells how far the two have moved
                        ///< since

  template <class Archive>
  void State(Archive& archive) {
    archive(index, stamp_s, keyframe, T_keyframe_frame, before, T_before_frame);
  }
};

/// Ids are indices; removed keyframes stay as empty shells, of dead landmarks the number alone is left after
/// a while. The world is the camera of a submap's first keyframe, the unit [m]; mono: the first scale.
class Map {
 public:
  /// A map without a camera: of keyframes and landmarks that somebody gives it. `scales`: size ratio of each
  /// level of the image pyramid to level 0.
  explicit Map(std::vector<float> scales) : scales_(std::move(scales)) {}
  /// Landmarks get patches of the image; `aligned_sigma`: OdometryOptions.
  Map(std::vector<float> scales, const CameraRig& rig, double aligned_sigma)
      : scales_(std::move(scales)), rig_(rig), aligned_sigma_(aligned_sigma) {}

  /// All ids are below it; those of removed keyframes are, too.
  int KeyframeCount() const { return static_cast<int>(keyframes_.size()); }
  /// All ids are below it; those of landmarks that are gone are, too.
  int LandmarkCount() const { return landmarks_.size(); }
  /// Ids of all keyframes that are in the map, ascending.
  std::vector<int> KeyframeIds() const;
  /// Ids of the landmarks that are in the map, ascending; keyframes see each of them.
  std::vector<int> LandmarkIds() const;
  const Keyframe& keyframe(int id) const { return keyframes_[static_cast<std::size_t>(id)]; }
  const Landmark& landmark(int id) const { return landmarks_[id]; }
  /// The landmark that one was merged into, which is dead since; -1: into none.
  int ReplacedBy(int landmark) const { return landmarks_.ReplacedBy(landmark); }
  /// The landmark itself, or the one that it ended in by merging; -1 if that one is gone, and for -1.
  int Present(int landmark) const;
  /// The keyframe itself, or the one that stands for it since it was removed.
  int PresentKeyframe(int keyframe) const;
  /// The frames that have a pose, in the order in which they were added.
  const SharedVector<MapFrame, 256>& frames() const { return frames_; }
  /// The number of the next submap: greater than all that keyframes have or had.
  int NextPiece() const { return next_piece_; }
  const std::vector<float>& scales() const { return scales_; }
  /// The camera that the map's pixels are of; there must be one.
  const CameraRig& rig() const { return *rig_; }
  double aligned_sigma() const { return aligned_sigma_; }

  /// Keyframes with at least `min_shared` common landmarks, most first (ties: newest first), at most `count`.
  std::vector<int> BestCovisible(int keyframe, int count, int min_shared) const;
  /// Landmarks that any of these keyframes sees, ascending.
  std::vector<int> LandmarksOf(const std::vector<int>& keyframes) const;
  /// Median depth of the landmarks that a keyframe sees [m]; 0 if it sees none.
  double MedianDepth(int keyframe) const;
  /// Standard deviation of a feature as a view of a landmark, where a corner's at level 0 is 1; `keyframe`:
  /// -1 for a frame that is none.
  double RelativeSigma(const FrameFeatures& features, int keyframe, int feature, int landmark) const;
  /// Whether a view of a landmark that has a patch never fitted a patch. Its corner is then often one of
  /// something else: an edge that hides what is behind it, the next of equal windows.
  bool Doubtful(const Observation& view, int landmark) const;

  /// For writing: a keyframe or landmark that a copy of the map shares is copied first.
  Keyframe& keyframe(int id) { return keyframes_.Mutable(static_cast<std::size_t>(id)); }
  Landmark& landmark(int id) { return landmarks_.Mutable(id); }
  MapFrame& frame(std::size_t i) { return frames_.Mutable(i); }
  int AddKeyframe(Keyframe keyframe);
  /// Adds a landmark seen by one feature; returns its id.
  int AddLandmark(const Eigen::Vector3d& position, int keyframe, int feature);
  void AddObservation(int landmark, int keyframe, int feature);
  void RemoveObservation(int landmark, int keyframe);
  void RemoveLandmark(int landmark);
  /// Takes a keyframe out of the map, for which an older one stands from then on. What it saw keeps its other
  /// views, or is removed if these are fewer than `least_views`.
  void RemoveKeyframe(int keyframe, int into, std::size_t least_views);
  /// Lets `winner` take over all that `loser` sees.
  void ReplaceLandmark(int loser, int winner);
  /// Recomputes descriptor, viewing direction and distances of a landmark.
  void UpdateLandmark(int landmark);
  /// Viewing direction and distances alone, after keyframes or the landmark have moved.
  void UpdateGeometry(int landmark);
  /// Viewing direction and distances of all landmarks.
  void UpdateGeometry();
  /// A frame has this pose, and hangs on this keyframe. `goes_on`: it was tracked from the frame before.
  void AddFrame(std::int64_t index, double stamp_s, int keyframe, const Pose& T_camera_world,
                bool goes_on = true);
  /// The frames are those of another state of the same map.
  void TakeFrames(const Map& from) { frames_ = from.frames_; }
  /// Gives the memory of dead landmarks back. References to landmarks end.
  void Compact() { landmarks_.Compact(); }

  /// The next keyframe, landmark or frame, as it was saved or stands in another map.
  void Restore(Keyframe keyframe);
  void Restore(Landmark landmark, int replaced_by) { landmarks_.Append(std::move(landmark), replaced_by); }
  void Restore(const MapFrame& frame) { frames_.Append(frame); }
  void RestorePieces(int next_piece) { next_piece_ = next_piece; }
  /// Throws InputError if what was restored does not fit together.
  void Check(const internal::SectionReader& file) const;

 private:
  std::vector<float> scales_;
  std::optional<CameraRig> rig_;
  double aligned_sigma_ = 1;
  SharedVector<Keyframe, 1> keyframes_;
  LandmarkStore landmarks_;
  SharedVector<MapFrame, 256> frames_;
  int next_piece_ = 0;
};

/// Pairs of keyframes (older id, newer id) that see at least `min_shared` common landmarks, with that number.
std::vector<std::pair<std::pair<int, int>, int>> Covisibility(const Map& map, int min_shared);

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
/// Everything about one keyframe, with the current map's points.
KeyframeView ViewOf(const Map& map, int keyframe);

/// Frames by their number (InputFrame::index, and the offset of their session): of one recording, for
/// example.
struct FrameRange {
  std::int64_t first = std::numeric_limits<std::int64_t>::min();
  std::int64_t last = std::numeric_limits<std::int64_t>::max();  ///< included
  bool Has(std::int64_t number) const { return number >= first && number <= last; }
};

/// Submaps that have frames, by number of frames, most first (ties: the older one). Joined submaps are one.
std::vector<int> FramePieces(const Map& map, const FrameRange& range = {});
/// All posed frames so far, T_world_camera, in order of time, through their reference keyframes (so
/// corrections and local bundle adjustment reach every frame, and leave no step between two). Only frames of
/// one submap, `piece`; -1: of the one with most frames.
Trajectory FrameTrajectory(const Map& map, int piece = -1, const FrameRange& range = {});
/// Same length as FrameTrajectory(map, piece, range): number of the frame of each pose.
std::vector<std::int64_t> FrameIndices(const Map& map, int piece = -1, const FrameRange& range = {});

}  // namespace tutti
#pragma GCC visibility pop
