// `tutti export`: a map in the formats of other programs.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/export/map_model.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// What to write where; what is not set is not written.
struct ExportRequest {
  std::optional<std::filesystem::path> landmarks;  ///< PLY file
  std::optional<std::filesystem::path> colmap;     ///< folder for sparse/0 and images
  std::optional<std::filesystem::path>
      transforms;                            ///< .../transforms.json; images and sparse_pc.ply beside it
  std::optional<std::filesystem::path> g2o;  ///< pose graph
  std::optional<std::filesystem::path> tum;  ///< trajectory
  std::size_t images = 300;                  ///< at most so many
};

/// One thing that was written.
struct ExportedFile {
  std::filesystem::path path;
  std::string content;    ///< "5321 landmarks, 83 cameras"
  std::string open_with;  ///< programs, and how to call them
};

/// What became of an export.
struct ExportReport {
  std::vector<ExportedFile> files;
  std::vector<std::string> warnings;
};

/// Writes the model. `dataset`: what the map was made of; null: landmarks are grey, with a warning. An
/// earlier export in a folder is replaced when the new one is complete. Throws InputError for a request that
/// asks for nothing, for images without a data set that has them, for a folder that holds what no export
/// wrote, and for what can't be written.
ExportReport ExportMap(MapModel model, const Dataset* dataset, const ExportRequest& request);

}  // namespace tutti
