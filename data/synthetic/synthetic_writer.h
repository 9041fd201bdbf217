// Writes a synthetic world to disk as a data set that `tutti run` (and other systems) can read.
#pragma once

#include <filesystem>
#include <functional>

#include "data/synthetic/synthetic_world.h"

namespace tutti {

/// How to write.
struct SyntheticWriteOptions {
  int threads = 1;     ///< frames rendered at the same time; the files do not depend on it
  bool force = false;  ///< write into a folder that is not empty: its image_0, image_1, images, rgb and
                       ///< depth lose their png files
  /// Called after each frame with (done, total), from one thread at a time; false: stop and keep what is
  /// there.
  std::function<bool(std::size_t, std::size_t)> progress;
};

/// Mono and stereo: the KITTI odometry layout (image_0, image_1, times.txt, calib.txt, poses.txt). RGB-D: the
/// TUM layout (rgb, depth, rgb.txt, depth.txt, groundtruth.txt). Beside them config.yaml, for `tutti run
/// --config`. Sides: images (from 000001.png; odd = left, even = right, as the City Centre set), times.txt
/// and poses.txt, for `tutti loops --join-pairs`. Returns the number of frames written (less than all if
/// `progress` said stop). Throws InputError if the folder is not empty or can't be written.
std::size_t WriteSyntheticDataset(const SyntheticWorld& world, const std::filesystem::path& folder,
                                  const SyntheticWriteOptions& options = {});

}  // namespace tutti
