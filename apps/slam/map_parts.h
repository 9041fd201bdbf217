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
    {'T', 'U', 'T', 'T', 'I', 'M', 'A', 'P'}, 20, "map", "tutti run or SlamSystem::Save"};

/// Sections of SlamSystem itself; the detector's are below 100, the odometry's from 100 to 199, those of
/// whoever called it from 300 on, at the end.
enum class MapSection : std::uint32_t {
  kInfo = 200,        ///< MapInfo, first
  kState = 201,       ///< of SlamSystem and LoopCloser
  kSolution = 202,    ///< of the pose graph, if it was being solved
  kAdjustment = 203,  ///< follows, if the map was being adjusted
  kDetector = 204     ///< results that were not taken yet; the detector follows, if there is one
};

/// Parts of MapSnapshot: cheap to get, some of them still to come.
struct MapSnapshot::Parts {
  std::string info, state;                 // sections
  std::optional<Odometry> odometry;        // a copy; with a calibration
  BackgroundLoopSolver::Pending solution;  // not valid: none
  std::optional<GlobalAdjustment> adjustment;
  std::shared_future<std::shared_ptr<const LoopWorker::Saved>> detector;  // not valid: none
};

/// What of a LoopCloser a map file has beside its State.
class MapFile {
 public:
  /// What is being worked out beside the tracking, which is held on to, and the detector.
  static void Save(const LoopCloser& loops, MapSnapshot::Parts* parts);
  /// Reads the detector, and touches nothing else: it may run beside what reads the rest.
  static void LoadDetector(internal::SectionReader* file, LoopCloser* loops);
  /// Reads what was being worked out from the next sections, if anything; goes on as if it were being worked
  /// out. Throws InputError, too, where the state that was read before names a keyframe that the odometry
  /// (nullptr: none) has not.
  static void LoadPending(internal::SectionReader* file, const Odometry* odometry, LoopCloser* loops);
};

}  // namespace tutti
