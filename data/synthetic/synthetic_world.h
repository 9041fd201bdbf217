// A deterministic synthetic world for tests, demos and benchmarks: images, depth and exact poses, no
// download.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "data/synthetic/synthetic_options.h"
#include "tutti/core/camera.h"
#include "tutti/core/trajectory.h"

namespace tutti {

namespace synthetic {
struct Face;
}

/// One rendered frame. The same as what is written to disk, except that depth is not rounded to 16 bit.
struct SyntheticFrame {
  double stamp_s = 0;
  cv::Mat image;    ///< CV_8UC1
  cv::Mat right;    ///< stereo and sides: CV_8UC1; else empty
  cv::Mat depth_m;  ///< RGB-D: CV_32FC1, z [m], 0 = not measured; else empty
  /// Left camera (sides: one between the two) at the middle of the exposure (rolling shutter: of the middle
  /// row); world = that of frame 0, or of the path.
  Pose T_world_camera;
};

/// A town, a room or a corridor with a camera moving through it. Immutable after construction: Render() may
/// be called from several threads.
class SyntheticWorld {
 public:
  /// Throws InputError for options that are not usable.
  explicit SyntheticWorld(const SyntheticOptions& options);
  ~SyntheticWorld();
  SyntheticWorld(SyntheticWorld&&) noexcept;

  const SyntheticOptions& Options() const;  ///< resolved: without zeros that mean "default"
  /// Of the left image; the right camera is baseline_m along its +x, unless a path says where it is.
  const PinholeCamera& Camera() const;
  std::size_t Size() const;
  double Stamp(std::size_t i) const;
  Pose PoseOf(std::size_t i) const;  ///< T_world_camera at Stamp(i)
  /// T_world_camera at any time [s], with a path counted from its first pose; before 0 the camera stands
  /// still.
  Pose PoseAt(double time_s) const;
  Trajectory GroundTruth() const;
  double LapLength() const;  ///< [m]
  std::size_t FramesPerLap() const;

  /// Renders frame i < Size().
  SyntheticFrame Render(std::size_t i) const;
  /// Frame i as another pose sees it, sharp and all rows at once: to hold the camera still, to turn it, to
  /// carry it elsewhere.
  SyntheticFrame RenderFrom(std::size_t i, const Pose& T_world_camera) const;
  /// Exact z depth of frame i without noise, limits, moving blur or rolling shutter (CV_32FC1 [m], 0 =
  /// nothing), for tests.
  cv::Mat ExactDepth(std::size_t i) const;

 private:
  friend std::vector<synthetic::Face> StillFaces(const SyntheticWorld& world);
  void SetUpPath();

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The exact geometry: all that does not move, in the world of the poses (data/synthetic/rasterizer.h).
std::vector<synthetic::Face> StillFaces(const SyntheticWorld& world);

/// How a world is written to disk.
struct SyntheticWriteOptions {
  int threads = 1;     ///< frames rendered at the same time; the files do not depend on it
  bool force = false;  ///< write into a folder that is not empty: its image_0, image_1, images, rgb and
                       ///< depth lose their png files
  /// Called after each frame with (done, total), from one thread at a time; false: stop and keep what is
  /// there.
  std::function<bool(std::size_t, std::size_t)> progress;
};

/// Writes a data set that `tutti run` (and other systems) can read.
/// Mono and stereo: the KITTI odometry layout (image_0, image_1, times.txt, calib.txt, poses.txt). RGB-D: the
/// TUM layout (rgb, depth, rgb.txt, depth.txt, groundtruth.txt). Beside them config.yaml, for `tutti run
/// --config`. Sides: images (from 000001.png; odd = left, even = right, as the City Centre set), times.txt
/// and poses.txt, for `tutti loops --join-pairs`. Returns the number of frames written (less than all if
/// `progress` said stop). Throws InputError if the folder is not empty or can't be written.
std::size_t WriteSyntheticDataset(const SyntheticWorld& world, const std::filesystem::path& folder,
                                  const SyntheticWriteOptions& options = {});

}  // namespace tutti
