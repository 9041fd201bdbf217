#include "apps/run/live_files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <exception>
#include <utility>

#include "apps/run/outputs.h"
#include "core/pose_columns.h"

namespace tutti {
namespace {

int OpenAnew(const std::filesystem::path& file) {
  struct stat status = {};
  // What shares its bytes with a file elsewhere (cp -l) makes way for a new one.
  if (lstat(file.c_str(), &status) == 0 && S_ISREG(status.st_mode) && status.st_nlink > 1)
    unlink(file.c_str());
  return open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0666);
}

}  // namespace

GrowingFile::GrowingFile(std::filesystem::path file, const std::string& header)
    : file_(std::move(file)), descriptor_(OpenAnew(file_)) {
  Append(header);
}

GrowingFile::~GrowingFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

void GrowingFile::Append(const std::string& lines) {
  if (descriptor_ < 0 && held_up_) return;  // it was never opened
  waiting_ += lines;
  const off_t begin = lseek(descriptor_, 0, SEEK_CUR);
  for (std::size_t done = 0; done < waiting_.size();) {
    const ssize_t size = write(descriptor_, waiting_.data() + done, waiting_.size() - done);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) {
      if (!std::exchange(held_up_, true)) {
        problem_ = file_.string() + " can't grow (" + std::strerror(errno) + "); the run goes on" +
                   (descriptor_ < 0 ? "" : ", and it is tried again");
      }
      // Half of what waits is taken back; if that fails, too, half a line stays.
      if (begin < 0 || ftruncate(descriptor_, begin) != 0 || lseek(descriptor_, begin, SEEK_SET) != begin)
        waiting_.erase(0, done);
      return;
    }
    done += static_cast<std::size_t>(size);
  }
  waiting_.clear();
  if (std::exchange(held_up_, false))
    problem_ = file_.string() + " grows again, and nothing is missing in it";
}

std::optional<std::string> GrowingFile::TakeProblem() { return std::exchange(problem_, std::nullopt); }

LiveFiles::LiveFiles(const std::filesystem::path& folder, const CameraRig& rig, const RunConfig& config)
    : T_camera_body_(rig.T_body_camera.Inverse()),
      members_(OtherMembers(config.loops.members)),
      loops_(folder / kLiveLoops, LoopsCsvHeader(members_)) {
  if (rig.calibrated) poses_.emplace(folder / kLiveTrajectory, internal::kTumHeader);
}

void LiveFiles::Add(double stamp_s, const TrackResult& track, const RunState& state) {
  AddLoops(state.loops);
  if (!poses_ || track.state != TrackingState::kTracking) return;
  trajectory_.push_back({stamp_s, track.T_world_camera * T_camera_body_});
  poses_->Append(internal::TumLine(trajectory_.back()));
}

void LiveFiles::AddLoops(const std::vector<Loop>& loops) {
  std::string lines;
  for (; loops_written_ < loops.size(); ++loops_written_)
    lines += LoopsCsvLine(loops[loops_written_], members_);
  if (!lines.empty()) loops_.Append(lines);
}

void LiveFiles::Resume(Trajectory trajectory, const std::vector<Loop>& loops) {
  AddLoops(loops);
  trajectory_ = std::move(trajectory);
  std::string lines;
  for (const StampedPose& pose : trajectory_) lines += internal::TumLine(pose);
  if (poses_ && !lines.empty()) poses_->Append(lines);
}

std::vector<std::string> LiveFiles::TakeProblems() {
  std::vector<std::string> problems;
  for (GrowingFile* file : {poses_ ? &*poses_ : nullptr, &loops_}) {
    const auto problem = file != nullptr ? file->TakeProblem() : std::nullopt;
    if (problem) problems.push_back(*problem);
  }
  return problems;
}

Checkpointer::~Checkpointer() {
  if (writing_.valid()) writing_.wait();
}

bool Checkpointer::Due() {
  if (writing_.valid()) {
    if (writing_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
    Wait();
  }
  return !since_ || since_->Seconds() >= interval_s_;
}

void Checkpointer::Begin(MapSnapshot snapshot, std::function<void(const MapSink&)> more) {
  Wait();
  since_.emplace();
  writing_ = std::async(std::launch::async, [file = file_, snapshot = std::move(snapshot),
                                             more = std::move(more)] { snapshot.Write(file, more); });
}

void Checkpointer::Wait() {
  if (!writing_.valid()) return;
  try {
    writing_.get();
  } catch (const std::exception& error) {
    problem_ = std::string("no checkpoint: ") + error.what();
  }
}

std::optional<std::string> Checkpointer::TakeProblem() { return std::exchange(problem_, std::nullopt); }

}  // namespace tutti
