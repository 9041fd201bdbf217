// `tutti localize`: where the frames of a data set are in a map that stays as it is.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "apps/run/run_observer.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/dataset.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

struct LocalizationRequest {
  std::filesystem::path map, dataset, out;
  std::optional<DatasetOptions> options;      ///< how to read the data set; none: as the map's was read
  std::optional<std::filesystem::path> mask;  ///< instead of that of the options
  std::optional<int> start, end, stride;      ///< instead of those of the options [frames]
  int threads = 2;
  bool quiet = false;  ///< no progress, no notes
  /// Get every frame and the map (RunState::OnlyLocated), but no keyframes and no answers of the detector.
  std::vector<std::shared_ptr<RunObserver>> observers;
};

/// One frame in the map.
struct LocalizedFrame {
  std::int64_t index = 0;  ///< InputFrame::index
  double stamp_s = 0;
  TrackResult track;                   ///< kTracking: it has a pose; else kLost
  bool recognised = false;             ///< the loop detector said where it is, after it was lost
  bool beyond = false;                 ///< it hangs on what was seen since, where the map shows too little
  int keyframe = -1;                   ///< of the map, that shares most landmarks with it; -1: beyond it
  std::optional<Matrix6d> covariance;  ///< PoseCovariance
};

struct Localization {
  std::vector<LocalizedFrame> frames;  ///< that could be read
  int map_keyframes = 0;               ///< keyframes from this id on are none of the map's
  std::size_t bad = 0;                 ///< that could not
  bool masked = false;                 ///< not all of the images is used
  std::size_t without_mask = 0;        ///< frames that could be read, without a mask
  Trajectory trajectory;               ///< T_world_body of those with a pose; the world is the map's
  double wall_s = 0, cpu_s = 0;        ///< without loading the map
  double load_s = 0;                   ///< of loading the map
  std::optional<double> first_pose_s;  ///< from the start, loading included, to the first pose
  bool interrupted = false;

  std::size_t Localized() const { return trajectory.size(); }
};

/// Locates each frame and writes trajectory.txt (TUM), localization.csv,
/// localization.svg and summary.json into request.out.
/// The map's file is only read. Throws InputError that names the file: no map, another camera than the map's,
/// no data, an output folder that can't be written or holds what tutti did not write.
Localization Localize(const LocalizationRequest& request);

}  // namespace tutti
