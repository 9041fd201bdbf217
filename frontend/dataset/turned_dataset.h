// A camera that was not upright: its images are turned.
#pragma once

#include <memory>
#include <string>

#include "tutti/frontend/dataset.h"

#pragma GCC visibility push(default)  // of the commands, too
namespace tutti {

/// The image turned clockwise by 0, 90, 180 or 270 degrees; an empty one stays empty.
cv::Mat TurnedImage(const cv::Mat& image, int degrees);

/// The camera whose images are those of `camera`, turned clockwise, with its distortion.
PinholeCamera TurnedCamera(const PinholeCamera& camera, int degrees);

/// Another data set whose images, masks and depth images are turned clockwise by 90, 180 or 270 degrees. The
/// rig's camera is turned with them, and T_body_camera the other way, so that the body's poses stay what they
/// are and the ground truth still fits.
class TurnedDataset : public Dataset {
 public:
  /// Throws InputError for stereo (a turned pair does not lie side by side) and for a rolling shutter (the
  /// rows would no longer be read one after the other); `name` is what the message calls the data set.
  TurnedDataset(std::unique_ptr<Dataset> stored, int degrees, const std::string& name);

  Supply FrameSupply() const override { return stored_->FrameSupply(); }
  bool WaitFor(std::size_t i, const std::function<bool()>& stop) const override {
    return stored_->WaitFor(i, stop);
  }
  std::size_t Size() const override { return stored_->Size(); }
  double Stamp(std::size_t i) const override { return stored_->Stamp(i); }
  std::int64_t Number(std::size_t i) const override { return stored_->Number(i); }
  ReadResult Read(std::size_t i) const override;
  ColourImage ReadColour(std::size_t i) const override;
  double SkippedShare() const override { return stored_->SkippedShare(); }
  const CameraRig& Rig() const override { return rig_; }
  std::optional<std::filesystem::path> GroundTruthFile() const override { return stored_->GroundTruthFile(); }
  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override {
    return stored_->ReadGroundTruth(file, warnings);
  }
  const std::vector<std::string>& Warnings() const override { return stored_->Warnings(); }

 private:
  std::unique_ptr<Dataset> stored_;
  int degrees_;
  CameraRig rig_;
};

}  // namespace tutti
#pragma GCC visibility pop
