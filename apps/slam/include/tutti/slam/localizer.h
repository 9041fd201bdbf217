// Where frames are in a map that stays as it is.
//
//   std::unique_ptr<SlamSystem> map = LoadMap(file, ReadMapInfo(file));
//   Localizer localizer(*map);
//   for (each frame) localizer.Track(frame);
#pragma once

#include <cstddef>
#include <cstdint>

#include "tutti/frontend/odometry.h"
#include "tutti/slam/slam_system.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Locates frames in the map of a SlamSystem: no loops, and keyframes only for the time being, where the map
/// shows too little of what is in view (FrameView::beyond_map). The map's detector says where a lost frame
/// was taken, the first one included, and beyond the map now and then whether it shows the place.
class Localizer {
 public:
  /// `map` must outlive this object; what it tracks meanwhile does not count. Throws InputError if there is
  /// no map, or no detector that knows it.
  explicit Localizer(const SlamSystem& map);

  /// The next frame, of the same rig as the map's; time stamps may begin anew. Never throws for hard images;
  /// throws InputError for those of another type or size than InputFrame and the rig say, and nothing has
  /// changed then.
  TrackResult Track(const InputFrame& frame);

  /// The map with the keyframes for the time being; its frames are those that were located.
  const Odometry& odometry() const { return odometry_; }
  /// Keyframes from this id on are none of the map's.
  int map_keyframes() const { return map_keyframes_; }
  /// Lost frames that got a pose because the detector knew their place.
  std::size_t Relocalized() const { return relocalized_; }

 private:
  TrackResult Relocalize(const InputFrame& frame, const TrackResult& tracked);

  const SlamSystem& map_;
  Odometry odometry_;
  int map_keyframes_;
  std::size_t relocalized_ = 0;
  int frames_beyond_ = 0;  // of the map
};

}  // namespace tutti
#pragma GCC visibility pop
