// A map file, or the folder of a run that has one, for the commands that make something of it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "apps/export/map_model.h"
#include "tutti/frontend/dataset.h"
#include "tutti/slam/map_file.h"

namespace tutti::cli {

/// map.tutti of a run's folder, or the file itself. Throws InputError if the folder has none.
std::filesystem::path MapFile(const std::string& run_or_map);

/// Which frames SavedMap::model's trajectory has.
enum class SessionFrames { kAll, kOfSession };

/// What a map holds.
struct SavedMap {
  MapInfo info;
  MapSession session;  ///< the recording whose images are used
  MapModel model;
};

/// `session`: counted from 1; 0: the last one. Throws InputError as LoadMap does, and for a map without poses
/// or without that session.
SavedMap ReadSavedMap(const std::filesystem::path& file, int session, SessionFrames frames);

/// The data set of the session, or `dataset` where it is now (empty: where it was); without masks. Null if
/// nothing says where it is, or it was a camera. Throws InputError as OpenDataset does.
std::unique_ptr<Dataset> OpenRecording(const SavedMap& map, const std::string& dataset);

}  // namespace tutti::cli
