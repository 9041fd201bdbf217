// The odometry's map: keyframes, landmarks and who sees what. A value type; copies share what is the same in
// both.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "frontend/features/features.h"
#include "frontend/map/landmark.h"
#include "frontend/map/landmark_store.h"
#include "frontend/map/shared_vector.h"
#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti::internal {
class SectionReader;
}

namespace tutti {

/// A frame that stays in the map.
struct Keyframe {
  int id = -1;
  int replaced_by = -1;  ///< older keyframe that stands for it since it was removed; -1: it is in the map
  std::int64_t frame_index = 0;
  double stamp_s = 0;
  int piece = 0;  ///< map piece
  Pose T_world_camera;
  std::shared_ptr<const FrameFeatures> features;
  std::vector<int> landmarks;    ///< per feature: landmark id or -1
  std::map<int, int> covisible;  ///< other keyframe -> number of common landmarks

  /// Defined in frontend/store/features_state.h.
  template <class Archive>
  void State(Archive& archive);
};

/// Map of one odometry. Ids are indices; removed keyframes stay as empty shells, of dead landmarks
/// the number alone is left after a while.
class Map {
 public:
  explicit Map(std::vector<float> scales) : scales_(std::move(scales)) {}
  /// With a camera and `aligned_sigma` (OdometryOptions), landmarks get patches.
  Map(std::vector<float> scales, const PinholeCamera& camera, double aligned_sigma)
      : scales_(std::move(scales)), camera_(camera), aligned_sigma_(aligned_sigma) {}

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
  void Merge(int loser, int winner);
  /// Standard deviation of a feature as a view of a landmark, where a corner's at level 0 is 1; `keyframe`:
  /// -1 for a frame that is none.
  double RelativeSigma(const FrameFeatures& features, int keyframe, int feature, int landmark) const;
  /// Whether a view of a landmark that has a patch never fitted a patch. Its corner is then often one of
  /// something else: an edge that hides what is behind it, the next of equal windows.
  bool Doubtful(const Observation& view, int landmark) const;
  /// Recomputes descriptor, viewing direction and distances of a landmark.
  void UpdateLandmark(int landmark);
  /// Viewing direction and distances alone, after keyframes or the landmark have moved.
  void UpdateGeometry(int landmark);
  /// The same for all landmarks.
  void UpdateGeometry();

  /// Keyframes with at least `min_shared` common landmarks, most first (ties: newest first), at most `count`.
  std::vector<int> BestCovisible(int keyframe, int count, int min_shared) const;

  int KeyframeCount() const { return static_cast<int>(keyframes_.size()); }  ///< removed ones too
  int LandmarkCount() const { return landmarks_.size(); }                    ///< dead ones too
  /// For writing: a keyframe or landmark that a copy of the map shares is copied first.
  Keyframe& keyframe(int id) { return keyframes_.Mutable(static_cast<std::size_t>(id)); }
  Landmark& landmark(int id) { return landmarks_.Mutable(id); }
  const Keyframe& keyframe(int id) const { return keyframes_[static_cast<std::size_t>(id)]; }
  const Landmark& landmark(int id) const { return landmarks_[id]; }
  /// The landmark that one was merged into, which is dead since; -1: into none.
  int ReplacedBy(int landmark) const { return landmarks_.ReplacedBy(landmark); }
  /// The landmark itself, or the one that it ended in by merging; -1 if that one is gone, and for -1.
  int Present(int landmark) const;
  /// The keyframe itself, or the one that stands for it since it was removed.
  int PresentKeyframe(int keyframe) const;
  const std::vector<float>& scales() const { return scales_; }

  /// Landmarks that any of these keyframes sees, ascending.
  std::vector<int> LandmarksOf(const std::vector<int>& keyframes) const;

  /// Median depth of the landmarks that a keyframe sees [m]; 0 if it sees none.
  double MedianDepth(int keyframe) const;

  /// Appends another map, which stands apart: its keyframes, pieces and landmarks get numbers after those
  /// that are there, its frames this offset. `first_piece`: what its piece 0 is called.
  void Append(const Map& other, std::int64_t frame_offset, int first_piece);

  /// Gives the memory of dead landmarks back. References to landmarks end.
  void Compact() { landmarks_.Compact(); }

  /// For loading: the next keyframe or landmark, as it was saved.
  void Restore(Keyframe keyframe) { keyframes_.Append(std::move(keyframe)); }
  void Restore(Landmark landmark, int replaced_by) { landmarks_.Append(std::move(landmark), replaced_by); }
  /// Throws InputError if what was restored does not fit together.
  void Check(const internal::SectionReader& file) const;

 private:
  std::vector<float> scales_;
  std::optional<PinholeCamera> camera_;
  double aligned_sigma_ = 1;
  SharedVector<Keyframe, 1> keyframes_;
  LandmarkStore landmarks_;
};

}  // namespace tutti
