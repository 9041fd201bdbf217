// Frames with the measurements of an IMU that were stored beside them.
#include <algorithm>
#include <system_error>
#include <utility>

#include "frontend/dataset/imu_file.h"
#include "frontend/dataset/layout.h"
#include "frontend/dataset/wrapped_dataset.h"
#include "frontend/imu/imu_examination.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// An IMU whose clock is late says of an image what its stamps put so much behind it.
constexpr double kAfterImage = 0.08;  // [s]
constexpr double kBeforeFirst = 0.5;  // of the first image [s]

class ImuDataset : public WrappedDataset {
 public:
  ImuDataset(std::unique_ptr<Dataset> whole, const ImuBeside& imu, const DatasetOptions& options)
      : WrappedDataset(std::move(whole)), warnings_(whole_->Warnings()) {
    try {
      samples_ = ReadImu(imu);
      report_ = CheckSamples(samples_);
      if (Size() > 0) CheckOverlap(samples_, Stamp(0), Stamp(Size() - 1), &report_);
    } catch (const InputError& error) {  // the images can be used all the same
      report_.findings.push_back({error.what(), "the run goes on without; --no-imu says nothing of it"});
    }
    std::string text = imu.file.string() +
                       (imu.topics.empty() ? ": " : ": " + JoinText(imu.topics, ", ") + ": ") +
                       ImuText(report_);
    text += imu.calibration.T_camera_imu ? ", mounting known" : ", mounting to be measured";
    warnings_.push_back(text + "; --no-imu leaves it out");
    for (const ImuFinding& finding : report_.findings)
      warnings_.push_back("warning: the IMU is left out: " + finding.measured + "; " + finding.advice);
    if (!report_.findings.empty()) {
      samples_.clear();
      return;
    }
    rig_.imu = imu.calibration;
    offset_s_ = options.time_offset_s;
  }

  ReadResult Read(std::size_t i) const override {
    ReadResult read = whole_->Read(i);
    if (!read.frame) return read;
    const auto later = [](double stamp, const ImuSample& sample) { return stamp < sample.stamp_s; };
    const double before = i == 0 ? Stamp(0) - kBeforeFirst : Stamp(i - 1) + kAfterImage;
    const auto first = std::upper_bound(samples_.begin(), samples_.end(), before - offset_s_, later);
    const auto end = std::upper_bound(first, samples_.end(), Stamp(i) + kAfterImage - offset_s_, later);
    read.frame->imu.assign(first, end);
    return read;
  }
  ColourImage ReadColour(std::size_t i) const override { return whole_->ReadColour(i); }
  std::optional<ImuReport> Imu() const override { return report_; }
  const std::vector<std::string>& Warnings() const override { return warnings_; }

 private:
  std::vector<ImuSample> samples_;
  std::vector<std::string> warnings_;
  ImuReport report_;
  double offset_s_ = 0;
};

// IMU -> camera of the rectified images, where the options or the layout say it.
std::optional<Pose> MountingOf(const ImuBeside& imu, const fs::path& folder, const CameraRig& rig,
                               const DatasetOptions& options) {
  const std::optional<Pose> T_left_imu = RigidTransform(options.T_camera_imu);
  if (!T_left_imu) {
    if (!imu.T_body_imu) return std::nullopt;
    return rig.T_body_camera.Inverse() * *imu.T_body_imu;
  }
  Pose T_body_left;  // nobody but EuRoC's layout has a body
  for (const char* yaml : {"mav0/cam0/sensor.yaml", "cam0/sensor.yaml"}) {
    std::error_code code;
    if (fs::is_regular_file(folder / yaml, code))
      T_body_left = ReadSensorYaml(folder / yaml).T_body_sensor.value_or(Pose());
  }
  return rig.T_body_camera.Inverse() * T_body_left * *T_left_imu;
}

}  // namespace

std::unique_ptr<Dataset> AddImu(std::unique_ptr<Dataset> whole, const fs::path& folder,
                                const DatasetOptions& options) {
  if (!options.imu || whole->FrameSupply() != Supply::kStored || !whole->Rig().calibrated) return whole;
  std::optional<ImuBeside> imu = FindImu(folder, options.imu_topic);
  if (!imu) return whole;
  imu->calibration.T_camera_imu = MountingOf(*imu, folder, whole->Rig(), options);
  imu->calibration.time_offset_s = options.time_offset_s;
  return std::make_unique<ImuDataset>(std::move(whole), *imu, options);
}

}  // namespace tutti
