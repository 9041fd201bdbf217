#include "tutti/slam/map_file.h"

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "apps/slam/map_parts.h"
#include "apps/slam/map_state.h"
#include "core/section_file.h"
#include "core/state_archive.h"
#include "frontend/odometry/odometry_file.h"
#include "loopclosure/detector/detector_file.h"
#include "tutti/core/error.h"

namespace tutti {

MapInfo ReadMapInfo(const std::filesystem::path& file) {
  internal::SectionReader in(file, kMapFile);
  MapInfo info;
  ReadState(in, MapSection::kInfo, &info);
  // A file that is read names no file that is written, and the map holds all that it needs of the memory.
  info.ltm_file = std::exchange(info.config.loops.ltm_file, {});
  return info;
}

void CheckMapFile(const std::filesystem::path& file) {
  internal::SectionReader in(file, kMapFile);
  std::string bytes;
  while (in.Next(&bytes) != internal::kEndOfSections) {
  }
}

void MapSnapshot::Write(const std::filesystem::path& file,
                        const std::function<void(const MapSink&)>& more) const {
  if (!parts_) throw InputError(file.string() + ": can't be written: the snapshot was moved elsewhere");
  internal::SectionWriter out(file, kMapFile);
  const MapSink sink = [&out](std::uint32_t tag, std::string_view bytes) { out.Write(tag, bytes); };
  out.Write(MapSection::kInfo, parts_->info);
  out.Write(MapSection::kState, parts_->state);
  std::map<std::int64_t, std::uint64_t> keyframes;  // where their sections are, by frame
  if (parts_->odometry) {
    int keyframe = 0;
    OdometryFile::Save(*parts_->odometry, [&](std::uint32_t tag, std::string_view bytes) {
      const std::uint64_t place = out.Write(tag, bytes);
      if (tag == Tag(OdometrySection::kKeyframe))
        keyframes[parts_->odometry->map().keyframe(keyframe++).frame_index] = place;
    });
  }
  if (parts_->solution.valid()) out.Write(MapSection::kSolution, StateOf(*parts_->solution.get()));
  if (parts_->adjustment) {
    out.Write(MapSection::kAdjustment, "");
    OdometryFile::Save(*parts_->adjustment, sink);
  }
  if (parts_->detector.valid()) {
    const LoopWorker::Saved& saved = *parts_->detector.get();
    out.Write(MapSection::kDetector, StateOf(saved));
    for (const auto& [tag, bytes] : saved.detector) {
      // The detector's view of a keyframe has the keyframe's features, too.
      const bool view = tag == internal::kViewSection;
      const auto keyframe = view ? keyframes.find(internal::LocationOfView(bytes)) : keyframes.end();
      out.Write(tag, bytes, keyframe != keyframes.end() ? keyframe->second : 0);
    }
  }
  if (more) more(sink);
  out.Finish();
}

void MapFile::Save(const LoopCloser& loops, MapSnapshot::Parts* parts) {
  parts->solution = loops.solver_.pending();
  parts->adjustment = loops.adjuster_.pending();
  if (loops.worker_) parts->detector = loops.worker_->Save();
}

void MapFile::LoadDetector(internal::SectionReader* file, LoopCloser* loops) {
  file->SkipTo(MapSection::kDetector);
  LoopWorker::Saved saved;
  ReadState(*file, MapSection::kDetector, &saved);
  loops->worker_->Resume(file, std::move(saved));
}

void MapFile::LoadPending(internal::SectionReader* file, const Odometry* odometry, LoopCloser* loops) {
  loops->Check(odometry != nullptr ? odometry->map().KeyframeCount() : 0, *file);
  const auto next = [file](MapSection section) {
    return file->Peek() == static_cast<std::uint32_t>(section);
  };
  if (next(MapSection::kSolution)) {
    LoopSolution solution;
    ReadState(*file, MapSection::kSolution, &solution);
    loops->solver_.Resume(std::move(solution));
  }
  std::optional<GlobalAdjustment> adjustment;
  if (next(MapSection::kAdjustment)) {
    file->Expect(MapSection::kAdjustment);
    if (odometry == nullptr) file->Damaged("an adjustment of no map");
    adjustment = OdometryFile::LoadAdjustment(odometry->map(), file);
  }
  loops->adjuster_.Resume(std::move(adjustment));
}

}  // namespace tutti
