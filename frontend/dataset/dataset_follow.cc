// A folder that is still being written to.
#include <algorithm>
#include <chrono>
#include <mutex>
#include <thread>

#include "core/stopwatch.h"
#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(50);
constexpr double kGiveUpAfter =
    1.0;  // a file that is still incomplete when newer ones are there is damaged [s]

/// Lists the folder again and again; a frame is there when its files can be decoded in full.
class FollowedDataset : public Dataset {
 public:
  FollowedDataset(std::function<FolderContents()> find, const DatasetOptions& options)
      : find_(std::move(find)), options_(options) {
    const internal::Stopwatch waited;
    while (true) {
      try {
        FolderContents contents = find_();
        base_ = std::make_unique<FolderDataset>(contents, options_);
        break;
      } catch (const InputError&) {  // nothing there yet, or half written
        if (waited.Seconds() > options_.follow_s) throw;
      }
      std::this_thread::sleep_for(kPoll);
    }
    frames_ = base_->Frames();
    since_growth_ = {};
  }

  Supply FrameSupply() const override { return Supply::kGrowing; }
  std::size_t Size() const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return frames_.size();
  }
  double Stamp(std::size_t i) const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return frames_.at(i).stamp_s;
  }
  double SkippedShare() const override { return base_->SkippedShare(); }
  const CameraRig& Rig() const override { return base_->Rig(); }
  const std::vector<std::string>& Warnings() const override { return base_->Warnings(); }
  // What grows has no complete ground truth.
  std::optional<std::filesystem::path> GroundTruthFile() const override { return std::nullopt; }
  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override {
    return base_->ReadGroundTruth(file, warnings);
  }

  bool WaitFor(std::size_t i, const std::function<bool()>& stop) const override {
    while (true) {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (frames_.size() <= i + 1 || Lacks(frames_[i])) Poll();
        const bool idle = since_growth_.Seconds() > options_.follow_s;
        if (i < frames_.size() && Complete(i, idle)) return true;
        if (idle) return i == frames_.size() && !std::exchange(told_, true) && !failure_.empty();
      }
      if (stop()) return false;
      std::this_thread::sleep_for(kPoll);
    }
  }

  ColourImage ReadColour(std::size_t i) const override {
    FrameFiles files;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (i >= frames_.size()) return {cv::Mat(), failure_};
      files = frames_[i];
    }
    return base_->ReadColourOf(files);
  }

  ReadResult Read(std::size_t i) const override {
    FrameFiles files;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (i >= frames_.size()) return {std::nullopt, failure_, {}};
      if (checked_ && checked_->first == i) return std::exchange(checked_, std::nullopt)->second;
      files = frames_[i];
    }
    return base_->ReadFiles(i, files);
  }

 private:
  // Takes the frames that are new. mutex_ is held.
  void Poll() const {
    std::vector<FrameFiles> now;
    try {
      now = find_().frames;
      failure_.clear();
    } catch (const InputError& e) {  // a list that is half written; told at the end if it stays so
      failure_ = e.what();
      return;
    }
    for (std::size_t i = 0; i < std::min(frames_.size(), now.size()); ++i) {
      if (now[i].image == frames_[i].image) continue;
      failure_ = now[i].image.string() +
                 ": is new, but sorts before images that were there already; use names that grow";
      return;
    }
    if (now.size() < frames_.size()) return;
    if (now.size() > frames_.size()) since_growth_ = {};
    frames_ = std::move(now);
  }

  bool Lacks(const FrameFiles& files) const {
    return options_.sensor != Sensor::kMono && files.right.empty() && files.depth.empty();
  }

  // The depth or right image of frame i may still be listed: no later frame has one. mutex_ is held.
  bool DepthMayCome(std::size_t i) const {
    if (!Lacks(frames_[i])) return false;
    if (!awaited_ || awaited_->first != i) awaited_ = {i, {}};
    if (awaited_->second.Seconds() > kGiveUpAfter) return false;
    return std::all_of(frames_.begin() + static_cast<std::ptrdiff_t>(i), frames_.end(),
                       [this](const FrameFiles& files) { return Lacks(files); });
  }

  // Frame i can be decoded in full, or never will be. mutex_ is held.
  bool Complete(std::size_t i, bool idle) const {
    if (!idle && DepthMayCome(i)) return false;
    ReadResult read = base_->ReadFiles(i, frames_[i]);
    const bool whole = read.frame && read.depth_error.empty();
    if (!whole && !idle && (i + 1 == frames_.size() || since_growth_.Seconds() < kGiveUpAfter)) return false;
    checked_ = {i, std::move(read)};
    return true;
  }

  std::function<FolderContents()> find_;
  DatasetOptions options_;
  std::unique_ptr<FolderDataset> base_;  // what was there at first
  mutable std::mutex mutex_;
  mutable std::vector<FrameFiles> frames_;                             // guarded by mutex_, as all below
  mutable std::optional<std::pair<std::size_t, ReadResult>> checked_;  // the frame that was waited for
  mutable internal::Stopwatch since_growth_;
  mutable std::optional<std::pair<std::size_t, internal::Stopwatch>> awaited_;  // frame whose depth may come
  mutable std::string failure_;                                                 // of the last listing
  mutable bool told_ = false;
};

}  // namespace

std::unique_ptr<Dataset> FollowFolder(std::function<FolderContents()> find, const DatasetOptions& options) {
  return std::make_unique<FollowedDataset>(std::move(find), options);
}

}  // namespace tutti
