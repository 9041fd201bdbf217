// The synthetic room, walked around in with an RGB-D camera, and its map.
#pragma once

#include <filesystem>
#include <memory>

#include "apps/export/map_model.h"
#include "tutti/frontend/dataset.h"
#include "tutti/slam/slam_system.h"

namespace tutti::testing {

/// What a run leaves.
struct MappedRoom {
  std::unique_ptr<Dataset> dataset;
  std::unique_ptr<SlamSystem> slam;
  MapModel Model() const { return ModelOf(*slam->odometry(), slam->Graph()); }
};

/// Runs on the first `frames` frames of a data set (0: all).
MappedRoom MapOf(const std::filesystem::path& config, const std::filesystem::path& dataset, int frames);

/// A short walk. Its map is made once for all tests, and loaded once per test program: don't change it.
const MappedRoom& Room();

/// Once round the room and a little farther, so that the loop is closed. Made once for all tests.
MappedRoom WholeRoom();

}  // namespace tutti::testing
