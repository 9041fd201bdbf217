#include "frontend/dataset/selected_dataset.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "tutti/core/error.h"

namespace tutti {
namespace {

// Drawn anew for each frame, so that it is the same whatever was read before, and by which thread.
void AddNoise(double sigma, std::uint64_t seed, cv::Mat& image) {
  if (image.empty()) return;
  cv::RNG random(seed);
  cv::Mat noise(image.size(), CV_32FC1), noisy;
  random.fill(noise, cv::RNG::NORMAL, 0, sigma);
  image.convertTo(noisy, CV_32FC1);
  noisy += noise;
  noisy.convertTo(image, CV_8UC1);
}

class SelectedDataset : public Dataset {
 public:
  SelectedDataset(std::unique_ptr<Dataset> whole, const DatasetOptions& options)
      : whole_(std::move(whole)),
        start_(static_cast<std::size_t>(options.start)),
        end_(options.end > 0 ? static_cast<std::size_t>(options.end)
                             : std::numeric_limits<std::size_t>::max()),
        stride_(static_cast<std::size_t>(options.stride)),
        noise_(options.noise),
        noise_draw_(static_cast<std::uint64_t>(options.noise_draw)),
        rig_(whole_->Rig()) {
    rig_.rate_hz /= options.stride;
  }

  Supply FrameSupply() const override { return whole_->FrameSupply(); }
  bool WaitFor(std::size_t i, const std::function<bool()>& stop) const override {
    return Place(i) < end_ && whole_->WaitFor(Place(i), stop);
  }
  std::size_t Size() const override {
    const std::size_t end = std::min(end_, whole_->Size());
    return end > start_ ? (end - start_ + stride_ - 1) / stride_ : 0;
  }
  double Stamp(std::size_t i) const override { return whole_->Stamp(Place(i)); }
  std::int64_t Number(std::size_t i) const override { return whole_->Number(Place(i)); }
  ReadResult Read(std::size_t i) const override {
    ReadResult read = whole_->Read(Place(i));
    if (!read.frame || noise_ <= 0) return read;
    const std::uint64_t seed = 2 * ((noise_draw_ << 32U) + static_cast<std::uint64_t>(read.frame->index)) + 1;
    AddNoise(noise_, seed, read.frame->image);
    AddNoise(noise_, seed + 1, read.frame->right);
    return read;
  }
  ColourImage ReadColour(std::size_t i) const override { return whole_->ReadColour(Place(i)); }
  double SkippedShare() const override { return whole_->SkippedShare(); }
  const CameraRig& Rig() const override { return rig_; }
  int TurnedBy() const override { return whole_->TurnedBy(); }
  std::optional<std::filesystem::path> GroundTruthFile() const override { return whole_->GroundTruthFile(); }
  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override {
    return whole_->ReadGroundTruth(file, warnings);
  }
  const std::vector<std::string>& Warnings() const override { return whole_->Warnings(); }

 private:
  std::size_t Place(std::size_t i) const { return start_ + i * stride_; }  // in whole_

  std::unique_ptr<Dataset> whole_;
  std::size_t start_, end_, stride_;
  double noise_;  // grey levels
  std::uint64_t noise_draw_;
  CameraRig rig_;
};

}  // namespace

std::unique_ptr<Dataset> SelectFrames(std::unique_ptr<Dataset> whole, const DatasetOptions& options,
                                      const std::string& name) {
  const bool all = options.start == 0 && options.end == 0 && options.stride == 1;
  if (all && options.noise <= 0) return whole;
  if (options.end != 0 && options.end <= options.start) {
    throw InputError("dataset: end must be greater than start (" + std::to_string(options.start) +
                     "); it is " + std::to_string(options.end));
  }
  const std::size_t frames = whole->Size();
  if (whole->FrameSupply() == Supply::kStored && static_cast<std::size_t>(options.start) >= frames) {
    throw InputError(name + ": has " + std::to_string(frames) + " frames, 0 to " +
                     std::to_string(frames - 1) + "; it can't start with frame " +
                     std::to_string(options.start));
  }
  return std::make_unique<SelectedDataset>(std::move(whole), options);
}

}  // namespace tutti
