// What a map file is made of.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "apps/slam/loop_closer.h"
#include "apps/slam/loop_worker.h"
#include "core/section_file.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/map_file.h"

namespace tutti {

inline constexpr internal::SectionFileKind kMapFile = {
    {'T', 'U', 'T', 'T', 'I', 'M', 'A', 'P'}, 16, "map", "tutti run or SlamSystem::Save"};

/// Sections of SlamSystem itself; the detector's are below 100, the odometry's from 100 to 199, those of
/// whoever called it from 300 on, at the end.
enum class MapSection : std::uint32_t {
  kInfo = 200,        ///< MapInfo, first
  kState = 201,       ///< of SlamSystem and LoopClosing
  kSolution = 202,    ///< of the pose graph, if it was being solved
  kAdjustment = 203,  ///< follows, if the map was being adjusted
  kDetector = 204     ///< results that were not taken yet; the detector follows, if there is one
};

/// Parts of MapSnapshot: cheap to get, some of them still to come.
struct MapSnapshot::Parts {
  std::string info, state;           // sections
  std::optional<Odometry> odometry;  // a copy; with a calibration
  LoopCloser::Pending pending;
  std::shared_future<std::shared_ptr<const LoopWorker::Saved>> detector;  // not valid: none
};

}  // namespace tutti
