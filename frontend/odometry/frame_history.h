// Where every frame was.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "frontend/map/map.h"
#include "frontend/odometry/tracked_frame.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

/// Poses of frames relative to their reference keyframes: corrections of the map reach all frames. The map
/// that is asked with must have the keyframes of the one that was added with. Value type.
class FrameHistory {
 public:
  void Add(const TrackedFrame& frame, const Pose& T_camera_world, const Keyframe& reference);
  /// The frames of another map, whose keyframes have numbers from `first_keyframe` on in this one.
  void Append(const FrameHistory& other, std::int64_t frame_offset, int first_keyframe);
  /// From now on frames of another recording are added, whose time stamps may begin anew.
  void BeginSession() { session_ = records_.size(); }
  /// True if no frame of this recording was added that is as late as this [s].
  bool IsLater(double stamp_s) const {
    return records_.size() == session_ || stamp_s > records_.back().stamp_s;
  }
  /// The newest `count` frames have drifted, evenly: by Exp(drift) until the frame that comes next, which has
  /// this rotation (world to camera).
  void Spread(const Map& map, int count, const Vector6d& drift, const Eigen::Quaterniond& R_camera_world);
  /// Keyframes were moved: with their scale, so are the distances of their frames.
  void Rescale(const std::map<int, Similarity>& S_world_keyframe);
  /// Keyframes were removed: their frames hang on those that stand for them, and stay where they are. `map`
  /// has the poses of both.
  void Rehang(const std::map<int, int>& into, const Map& map);

  /// Pieces of the map that have frames, by number of frames, most first (ties: the older one).
  std::vector<int> Pieces(const Map& map, const FrameRange& range = {}) const;
  /// T_world_camera of the frames of one piece, in the order in which they were added; -1: of the piece with
  /// most frames.
  Trajectory Poses(const Map& map, int piece, const FrameRange& range = {}) const;
  /// Same length as Poses: number of the frame of each pose.
  std::vector<std::int64_t> Indices(const Map& map, int piece, const FrameRange& range = {}) const;

  template <class Archive>
  void State(Archive& archive) {
    std::uint64_t session = session_;
    archive(records_, session);
    if constexpr (Archive::kReading) {
      if (session > records_.size()) archive.Damaged("a recording that begins after its frames");
      session_ = static_cast<std::size_t>(session);
    }
  }
  /// Throws InputError if the state does not fit the map.
  void Check(const Map& map, const internal::SectionReader& file) const;

 private:
  struct Record {
    std::int64_t index = 0;
    double stamp_s = 0;
    int reference = -1;
    Pose T_reference_frame;

    template <class Archive>
    void State(Archive& archive) {
      archive(index, stamp_s, reference, T_reference_frame);
    }
  };
  std::vector<const Record*> Of(const Map& map, int piece, const FrameRange& range) const;

  std::vector<Record> records_;
  std::size_t session_ = 0;  // records_ from here on are of the present recording
};

}  // namespace tutti
