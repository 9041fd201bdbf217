// The odometry's map: keyframes, landmarks and who sees what. A value type; copies share what is the same in
// both.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "frontend/features/features.h"
#include "frontend/map/shared_vector.h"
#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti::internal {
class SectionReader;
}

namespace tutti {

/// Feature `feature` of keyframe `keyframe` sees a landmark.
struct Observation {
  int keyframe = -1;
  int feature = -1;

  template <class Archive>
  void State(Archive& archive) {
    archive(keyframe, feature);
  }
};

/// What a landmark looks like in the keyframe that made it, at the pyramid level of its corner.
struct Patch {
  static constexpr int kHalf = 8;  // [px of the level]
  static constexpr int kSide = 2 * kHalf + 1;
  std::array<std::uint8_t, kSide * kSide> grey{};
  float offset_x = 0, offset_y = 0;  ///< of the landmark from the patch's centre [px of the level]
  float scale_x = 1, scale_y = 1;    ///< level-0 pixels per pixel of the level

  /// All but `grey`: those of many landmarks are saved as one image.
  template <class Archive>
  void State(Archive& archive) {
    archive(offset_x, offset_y, scale_x, scale_y);
  }
};

/// A 3D point.
struct Landmark {
  bool alive = false;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in the world [m]
  Eigen::Vector3d normal =
      Eigen::Vector3d::Zero();               ///< mean viewing direction (unit), from the cameras to the point
  float min_distance = 0, max_distance = 0;  ///< distances at which its corner can be detected [m]
  std::array<std::uint8_t, 32> descriptor{};  ///< the most central of its descriptors
  std::vector<Observation> observations;      ///< ascending by keyframe; one per keyframe at most
  int reference = -1;                         ///< keyframe that made it
  std::shared_ptr<const Patch> patch;         ///< null if there was no image
  Observation patch_source;                   ///< what the patch is of
  int visible = 0, found = 0;                 ///< frames that should see it, and that did
  int replaced_by = -1;                       ///< landmark that it was merged into, if it is not alive

  /// All but `descriptor`, which is a keyframe's as a rule; of a dead one nobody asks for more than what
  /// replaced it.
  template <class Archive>
  void State(Archive& archive) {
    archive(alive);
    if (!alive) return archive(replaced_by);
    std::optional<Patch> own;
    if (patch) own = *patch;
    archive(position, normal, min_distance, max_distance, observations, reference, own, patch_source, visible,
            found);
    if (Archive::kReading && own) patch = std::make_shared<const Patch>(*own);
  }
};

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

/// Map of one odometry. Ids are indices; dead landmarks and removed keyframes stay as empty shells.
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
  int LandmarkCount() const { return static_cast<int>(landmarks_.size()); }  ///< dead ones too
  /// For writing: a keyframe or landmark that a copy of the map shares is copied first.
  Keyframe& keyframe(int id) { return keyframes_.Mutable(static_cast<std::size_t>(id)); }
  Landmark& landmark(int id) { return landmarks_.Mutable(static_cast<std::size_t>(id)); }
  const Keyframe& keyframe(int id) const { return keyframes_[static_cast<std::size_t>(id)]; }
  const Landmark& landmark(int id) const { return landmarks_[static_cast<std::size_t>(id)]; }
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

  /// For loading: the next keyframe or landmark, as it was saved.
  void Restore(Keyframe keyframe) { keyframes_.Append(std::move(keyframe)); }
  void Restore(Landmark landmark) { landmarks_.Append(std::move(landmark)); }
  /// Throws InputError if what was restored does not fit together.
  void Check(const internal::SectionReader& file) const;

 private:
  std::vector<float> scales_;
  std::optional<PinholeCamera> camera_;
  double aligned_sigma_ = 1;
  SharedVector<Keyframe, 1> keyframes_;
  SharedVector<Landmark, 64> landmarks_;
};

}  // namespace tutti
