// `tutti dense`: a map and its recording in, surfaces and free space out.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apps/export/map_export.h"
#include "apps/export/map_model.h"
#include "tutti/dense/dense_map.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// Which frames with a pose are used.
enum class DenseFrames { kAll, kKeyframes };
EnumWords<DenseFrames> WordsOf(DenseFrames);

/// What to write where; what is not set is not written.
struct ReconstructionRequest {
  DenseOptions dense;
  DenseFrames frames = DenseFrames::kAll;        ///< with `depth` always keyframes
  std::optional<std::filesystem::path> depth;    ///< folder for OpenDepth
  std::optional<std::filesystem::path> cloud;    ///< PLY file
  std::optional<std::filesystem::path> mesh;     ///< PLY file
  std::optional<std::filesystem::path> grid;     ///< folder for map.pgm and map.yaml
  std::optional<std::filesystem::path> octomap;  ///< .bt file
  std::optional<std::filesystem::path> esdf;     ///< .vdb file
  std::optional<std::filesystem::path> report;   ///< folder of a run whose report shows the surface
  double low_m = 0.1;                            ///< grid: lower obstacles are driven over
  double robot_height_m = 1.0;                   ///< grid: what hangs higher is driven under
  bool quiet = false;                            ///< no progress, no notes
};

/// What became of it.
struct Reconstruction {
  std::vector<ExportedFile> files;
  std::vector<std::string> warnings;
  DenseReport dense;
  std::size_t frames = 0;    ///< that were to be used
  bool interrupted = false;  ///< the files have what was integrated until then
};

/// Throws InputError for what can be known before the images are read: nothing is asked for, a library is not
/// there, a file can't be written.
void CheckReconstruction(const ReconstructionRequest& request);

/// Integrates the frames of the data set with the model's poses, in their order, and writes the files. Frames
/// that can't be used are skipped and counted. Signals end it early, with the files written (InterruptGuard).
/// Throws InputError as CheckReconstruction and OpenDepth, for a data set of another camera, for one without
/// a frame of the model, and for files that can't be written.
Reconstruction Reconstruct(const MapModel& model, const Dataset& dataset,
                           const ReconstructionRequest& request);

}  // namespace tutti
