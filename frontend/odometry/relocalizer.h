// A second chance for the frame that tracking has lost.
#pragma once

#include <optional>
#include <vector>

#include "frontend/odometry/rolling_search.h"
#include "frontend/odometry/tracked_frame.h"
#include "tutti/frontend/map.h"

namespace tutti {

/// Keeps the frames without a pose. The last of them can be searched for at a keyframe that the loop detector
/// has recognised. Once a later frame has a pose, the others are tracked backwards from there. Tells when to
/// give the map up. Value type.
class Relocalizer {
 public:
  Relocalizer(const OdometryOptions& options, const CameraRig& rig)
      : options_(options), search_(options, rig) {}

  /// The frame has a pose: nothing is lost.
  void Found();
  /// The frame has no pose because there is no map yet.
  void Wait(const TrackedFrame& frame);
  /// The map has no pose for the frame. True: since longer than OdometryOptions::relocalize_s, frames with
  /// something to see were lost. A covered lens says nothing about the place, and does not start that clock.
  bool Lose(const TrackedFrame& frame);

  /// The frames without a pose since the last one with a pose, oldest first, without their images; of very
  /// many, the newest.
  const std::vector<TrackedFrame>& Lost() const { return earlier_; }
  /// The same; forgets them.
  std::vector<TrackedFrame> TakeLost();

  /// Whether there is a frame to look for.
  bool HasFrame() const { return lost_.has_value(); }
  /// Where that frame is if it shows the same place as a keyframe. None if it does not, or if there is none.
  std::optional<PoseFix> FindAt(int keyframe, const Map& map) const;

  template <class Archive>
  void State(Archive& archive) {
    archive(lost_, since_s_, earlier_);
  }
  /// Throws InputError if the state does not fit the map.
  void Check(const Map& map, const internal::SectionReader& file) const;

 private:
  void Keep(const TrackedFrame& frame);

  OdometryOptions options_;
  RollingSearch search_;
  std::optional<TrackedFrame> lost_;
  std::vector<TrackedFrame> earlier_;  // without a pose, up to lost_
  std::optional<double> since_s_;      // first lost frame with something to see [s]
};

}  // namespace tutti
