// A live camera, camera:0, or a stream, rtsp://...; or a video file in its stead, camera:FILE: frames come
// once, in order.
#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <map>
#include <mutex>

#include "core/stopwatch.h"
#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/video_input.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

constexpr const char* kPrefix = "camera:";

class CameraDataset : public Dataset {
 public:
  CameraDataset(const std::string& name, const DatasetOptions& options) : name_(name) {
    Open(IsStream(name) ? name : name.substr(std::string(kPrefix).size()), options);
    const double rate = options.rate_hz > 0 ? options.rate_hz : capture_.get(cv::CAP_PROP_FPS);
    rate_hz_ = rate > 0 && rate < 1e4 ? rate : 30.0;
    if (!Grab())
      throw InputError(name_ + ": delivers no image; is it " +
                       (IsStream(name_) ? "a stream of video?" : "in use by another program?"));
    rig_ = SingleCameraRig(options, frames_.at(0).image.size(), rate_hz_, name_, rectifier_, warnings_);
    size_ = frames_.at(0).image.size();
    mask_ = SingleCameraMask(options, size_, rectifier_);
  }

  Supply FrameSupply() const override { return Supply::kOnce; }
  std::size_t Size() const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return stamps_.size();
  }
  double Stamp(std::size_t i) const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return stamps_.at(i);
  }
  bool WaitFor(std::size_t i, const std::function<bool()>& stop) const override {
    while (Size() <= i) {
      if (stop() || !Grab()) return false;
    }
    return true;
  }
  const CameraRig& Rig() const override { return rig_; }
  std::optional<std::filesystem::path> GroundTruthFile() const override { return std::nullopt; }
  const std::vector<std::string>& Warnings() const override { return warnings_; }
  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override {
    return ReadTrajectory(file, GuessTrajectoryFormat(file), warnings);
  }

  ReadResult Read(std::size_t i) const override {
    ReadResult result;
    InputFrame frame;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const auto found = frames_.find(i);
      if (found == frames_.end()) {
        result.error =
            name_ + ": frame " + std::to_string(i) + " is gone; a camera's frames come once, in order";
        return result;
      }
      frame = std::move(found->second);
      frames_.erase(frames_.begin(), std::next(found));
    }
    if (frame.image.size() != size_) {
      result.error = name_ + ": frame " + std::to_string(i) + " has another size than the first";
      return result;
    }
    if (rectifier_) frame.image = rectifier_->Apply(frame.image);
    frame.mask = mask_;
    result.frame = std::move(frame);
    return result;
  }

 private:
  void Open(const std::string& source, const DatasetOptions& options) {
    device_ = IsCameraDevice(name_);
    if (IsStream(name_)) return OpenVideoStream(source, capture_);
    if (!device_) return OpenVideoFile(source, capture_);
    bool opened = false;
    try {
      opened = capture_.open(static_cast<int>(*ParseInteger(source)), cv::CAP_V4L2);
    } catch (const cv::Exception&) {  // no such camera, or OpenCV was built without V4L2
    }
    if (!opened) {
      throw InputError(name_ + ": there is no such camera (/dev/video" + source +
                       "), or no permission to use it; is it plugged in, and are you in the group video?");
    }
    if (options.camera && options.camera->width > 0) {
      capture_.set(cv::CAP_PROP_FRAME_WIDTH, options.camera->width);
      capture_.set(cv::CAP_PROP_FRAME_HEIGHT, options.camera->height);
    }
    if (options.rate_hz > 0) capture_.set(cv::CAP_PROP_FPS, options.rate_hz);
  }

  // Takes the next image into frames_; false at the end. Of one thread at a time.
  bool Grab() const {
    InputFrame frame;
    bool good = false;
    try {
      good = ReadGreyFrame(capture_, frame.image);
    } catch (const cv::Exception&) {
      good = false;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!good) return false;
    // A device's stamps are seconds since 1970, by a clock that can't go back.
    frame.stamp_s =
        device_ ? begin_s_ + since_begin_.Seconds() : static_cast<double>(stamps_.size()) / rate_hz_;
    if (!stamps_.empty() && frame.stamp_s <= stamps_.back()) frame.stamp_s = stamps_.back() + 1e-6;
    frame.index = static_cast<std::int64_t>(stamps_.size());
    frames_[stamps_.size()] = std::move(frame);
    stamps_.push_back(frames_.rbegin()->second.stamp_s);
    return true;
  }

  std::string name_;
  bool device_ = false;
  CameraRig rig_;
  cv::Size size_;
  cv::Mat mask_;
  std::vector<std::string> warnings_;
  std::optional<Rectifier> rectifier_;
  double rate_hz_ = 30;
  const internal::Stopwatch since_begin_;
  const double begin_s_ =
      std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  mutable cv::VideoCapture capture_;
  mutable std::mutex mutex_;
  mutable std::vector<double> stamps_;                // guarded by mutex_
  mutable std::map<std::size_t, InputFrame> frames_;  // not read yet; guarded by mutex_
};

}  // namespace

bool IsStream(const std::string& name) {
  constexpr std::array<const char*, 4> kSchemes = {"rtsp://", "rtsps://", "http://", "https://"};
  return std::any_of(kSchemes.begin(), kSchemes.end(),
                     [&](const char* scheme) { return name.rfind(scheme, 0) == 0; });
}

bool IsCamera(const std::string& name) { return name.rfind(kPrefix, 0) == 0 || IsStream(name); }

bool IsCameraDevice(const std::string& name) {
  if (IsStream(name)) return true;
  const std::string source = IsCamera(name) ? name.substr(std::string(kPrefix).size()) : std::string();
  return !source.empty() && source.size() < 5 &&
         std::all_of(source.begin(), source.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

std::unique_ptr<Dataset> OpenCamera(const std::string& name, const DatasetOptions& options) {
  if (options.sensor != Sensor::kMono) throw InputError(name + ": a camera is mono; set sensor to mono");
  return std::make_unique<CameraDataset>(name, options);
}

}  // namespace tutti
