#include "apps/tutti/saved_map.h"

#include "apps/run/runner.h"
#include "tutti/core/error.h"
#include "tutti/slam/slam_system.h"

namespace tutti::cli {

namespace fs = std::filesystem;

fs::path MapFile(const std::string& run_or_map) {
  std::error_code ignored;
  if (!fs::is_directory(run_or_map, ignored)) return run_or_map;
  fs::path file = fs::path(run_or_map) / "map.tutti";
  if (!fs::exists(file, ignored))
    throw InputError(file.string() +
                     ": is not there; `tutti run` writes it when it has finished, unless it "
                     "was told --no-map");
  return file;
}

SavedMap ReadSavedMap(const fs::path& file, int session, SessionFrames of) {
  SavedMap map;
  map.info = ReadMapInfo(file);
  const std::unique_ptr<SlamSystem> slam = LoadMap(file, map.info);
  if (slam->odometry() == nullptr)
    throw InputError(file.string() +
                     ": has no poses, since the camera had no calibration; nothing to export");
  const std::size_t sessions = map.info.sessions.size();
  if (static_cast<std::size_t>(session) > sessions)
    throw InputError("--session " + std::to_string(session) + ": " + file.string() + " has " +
                     std::to_string(sessions));
  const std::size_t chosen = session > 0 ? static_cast<std::size_t>(session) : sessions;
  map.session = map.info.sessions[chosen - 1];
  FrameRange frames;
  if (of == SessionFrames::kOfSession) {
    frames.first = map.session.frame_offset;
    if (chosen < sessions) frames.last = map.info.sessions[chosen].frame_offset - 1;
  }
  map.model = ModelOf(*slam->odometry(), slam->Graph(), frames);
  map.model.image_offset = map.session.frame_offset;
  return map;
}

std::unique_ptr<Dataset> OpenRecording(const SavedMap& map, const std::string& dataset) {
  const std::string path = dataset.empty() ? DatasetOfNote(map.session.note) : dataset;
  if (path.empty() || IsCamera(path)) return nullptr;
  DatasetOptions options = map.info.config.dataset;
  options.mask.clear();  // colours and pictures are of the whole images
  return OpenDataset(path, options);
}

}  // namespace tutti::cli
