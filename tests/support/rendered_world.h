// The synthetic world for tests of what works on its frames: each frame is rendered once for all test
// programs.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "data/synthetic/synthetic_world.h"

namespace tutti::testing {

/// The options as a text that tells worlds apart.
std::string TextOf(const SyntheticOptions& options);

/// A SyntheticWorld that keeps its frames in the build folder (MadeOnce), by its options and the renderer's
/// code. The same bytes as SyntheticWorld gives. For one thread.
class RenderedWorld {
 public:
  explicit RenderedWorld(const SyntheticOptions& options);

  const SyntheticOptions& Options() const { return options_; }  ///< resolved
  const PinholeCamera& Camera() const { return camera_; }
  std::size_t Size() const { return size_; }
  std::size_t FramesPerLap() const { return frames_per_lap_; }
  SyntheticFrame Render(std::size_t i) const;
  /// For views that are not kept.
  const SyntheticWorld& World() const;

 private:
  SyntheticOptions given_, options_;
  PinholeCamera camera_;
  std::size_t size_ = 0, frames_per_lap_ = 0;
  mutable std::unique_ptr<SyntheticWorld> world_;  // made when something is to be rendered
  std::filesystem::path folder_;
};

}  // namespace tutti::testing
