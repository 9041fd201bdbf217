// Data sets made of another one: a part of its frames, with noise if wanted; or images that are turned, of a
// camera that was not upright.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tutti/frontend/dataset.h"

#pragma GCC visibility push(default)  // of the commands, too
namespace tutti {

/// Gives what another data set gives, but for its images: that is left to who derives from it.
class WrappedDataset : public Dataset {
 public:
  Supply FrameSupply() const override { return whole_->FrameSupply(); }
  bool WaitFor(std::size_t i, const std::function<bool()>& stop) const override {
    return whole_->WaitFor(i, stop);
  }
  std::size_t Size() const override { return whole_->Size(); }
  double Stamp(std::size_t i) const override { return whole_->Stamp(i); }
  std::int64_t Number(std::size_t i) const override { return whole_->Number(i); }
  int TurnedBy() const override { return whole_->TurnedBy(); }
  std::optional<ImuReport> Imu() const override { return whole_->Imu(); }
  double SkippedShare() const override { return whole_->SkippedShare(); }
  const CameraRig& Rig() const override { return rig_; }
  std::optional<std::filesystem::path> GroundTruthFile() const override { return whole_->GroundTruthFile(); }
  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override {
    return whole_->ReadGroundTruth(file, warnings);
  }
  const std::vector<std::string>& Warnings() const override { return whole_->Warnings(); }

 protected:
  explicit WrappedDataset(std::unique_ptr<Dataset> whole) : whole_(std::move(whole)), rig_(whole_->Rig()) {}

  std::unique_ptr<Dataset> whole_;
  CameraRig rig_;
};

/// The image turned clockwise by 0, 90, 180 or 270 degrees; an empty one stays empty.
cv::Mat TurnedImage(const cv::Mat& image, int degrees);

/// The camera whose images are those of `camera`, turned clockwise, with its distortion.
PinholeCamera TurnedCamera(const PinholeCamera& camera, int degrees);

/// The data set with images, masks and depth images turned clockwise by 90, 180 or 270 degrees. The rig's
/// camera is turned with them, and T_body_camera the other way, so that the body's poses stay what they are
/// and the ground truth still fits. Throws InputError for stereo (a turned pair does not lie side by side)
/// and for a rolling shutter (the rows would no longer be read one after the other); `name` is what the
/// message calls the data set.
std::unique_ptr<Dataset> TurnFrames(std::unique_ptr<Dataset> stored, int degrees, const std::string& name);

/// The frames options.start, start + stride, ... before options.end of `whole`, which keep their stamps and
/// their numbers (InputFrame::index), with options.noise. `whole` itself if that is all it has. Throws
/// InputError for an end that is not after the start, and if all of a stored data set's frames are left out.
std::unique_ptr<Dataset> SelectFrames(std::unique_ptr<Dataset> whole, const DatasetOptions& options,
                                      const std::string& name);

/// The data set with the measurements of the IMU that lies in `folder` beside its images, or in the bag, if
/// there is one, it is stored, and options.imu. A damaged file is a finding of Dataset::Imu. Throws
/// InputError for a damaged sensor.yaml.
std::unique_ptr<Dataset> AddImu(std::unique_ptr<Dataset> whole, const std::filesystem::path& folder,
                                const DatasetOptions& options);

}  // namespace tutti
#pragma GCC visibility pop
