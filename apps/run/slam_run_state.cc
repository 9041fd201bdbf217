// A run on disk: its checkpoints, and how it goes on from one, or in the map of another.
#include <algorithm>
#include <map>
#include <utility>

#include "apps/run/run_note.h"
#include "apps/run/slam_run.h"
#include "apps/slam/map_state.h"
#include "frontend/odometry/odometry_file.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kRunSection = 300;  // of a checkpoint; the odometry without loops may follow

}  // namespace

template <class Archive>
void SlamRun::State(Archive& archive) {
  bool has_alone = alone_ != nullptr;
  std::int64_t alone_last = has_alone ? alone_->last() : -1;
  Trajectory live = live_.trajectory();
  std::map<std::string, std::string> collected;
  if constexpr (!Archive::kReading) {
    for (const auto& observer : request_.observers) {
      if (*observer->Name() != '\0') collected[observer->Name()] = observer->Save();
    }
  }
  archive(so_far_, planted_, live, alone_last, has_alone, collected);
  StateOfGrowing(archive, result_);
  if constexpr (Archive::kReading) {
    if (has_alone) resumed_alone_ = alone_last;
    resumed_live_ = std::move(live);
    for (const auto& observer : request_.observers) {
      const auto found = collected.find(observer->Name());
      if (found != collected.end()) observer->Load(found->second, request_.resume->string());
    }
  }
}

void SlamRun::WriteCheckpoint() {
  so_far_.wall_s = WallSeconds();
  so_far_.cpu_s = CpuSeconds();
  std::optional<Odometry> alone;
  if (alone_) alone = alone_->Tracked();
  const auto write = [run = StateOf(*this), alone = std::move(alone)](const MapSink& sink) {
    sink(kRunSection, run);
    if (alone) OdometryFile::Save(*alone, sink);
  };
  checkpoints_->Begin(slam_->Snapshot(NoteOf(request_)), write);
}

void SlamRun::EndCheckpoints(Progress& progress) {
  checkpoints_->Wait();
  if (!result_.interrupted) return;
  WriteCheckpoint();
  checkpoints_->Wait();
  if (const auto problem = checkpoints_->TakeProblem()) {
    progress.Note("tutti: warning: " + *problem);
  } else {
    progress.Note("tutti: go on with: tutti run --resume " + request_.out.string());
  }
}

void SlamRun::GoOnIn(const fs::path& map) {
  MapInfo info = ReadMapInfo(map);
  if (!info.rig.calibrated || !result_.rig.calibrated)
    throw InputError(map.string() +
                     ": a recording can only go on in a map with poses, which needs calibrated "
                     "cameras on both sides");
  if (!info.config.run.loops || !config_.run.loops)
    throw InputError(map.string() +
                     ": without loop closure (run.loops, --no-loops) nothing would connect a "
                     "recording with the map; both need it");
  info.config = Watched(config_, request_);
  slam_ = LoadMap(map, info, Recorder());
  try {
    slam_->BeginSession(result_.rig);
  } catch (const InputError& error) {
    throw InputError(map.string() + ": " + result_.dataset + " can't go on in it: " + error.what());
  }
  live_.Skip(LoopsBefore());
}

std::size_t SlamRun::LoopsBefore() const {
  const std::int64_t first = FirstFrame();
  return static_cast<std::size_t>(std::count_if(slam_->loops().begin(), slam_->loops().end(),
                                                [&](const Loop& l) { return l.query < first; }));
}

void SlamRun::Resume(const fs::path& checkpoint) {
  MapInfo info = ReadMapInfo(checkpoint);
  if (StateOf(info.rig) != StateOf(result_.rig))
    throw InputError(checkpoint.string() + ": is of another camera than the data set has by now");
  info.config = Watched(config_, request_);
  slam_ = LoadMap(checkpoint, info, Recorder(), [this](internal::SectionReader& file) {
    ReadState(file, kRunSection, this);
    if (!resumed_alone_) return;
    Odometry alone(config_.odometry, result_.rig);
    OdometryFile::Load(&file, &alone);
    alone_ = std::make_unique<OdometryAlone>(alone, *resumed_alone_, AloneBeside());
  });
  live_.Skip(LoopsBefore());
  live_.Resume(std::move(resumed_live_), slam_->loops());
  before_ = so_far_;
  for (const auto& [index, position] : so_far_.positions) {
    if (position >= dataset_.Size() || dataset_.Number(position) != index)
      throw InputError(checkpoint.string() + ": is of another data set than " + result_.dataset +
                       " holds by now");
  }
  const std::size_t next = so_far_.next;
  result_.resumed_from_frame = next < dataset_.Size() ? dataset_.Number(next) : info.last_frame + 1;
}

}  // namespace tutti
