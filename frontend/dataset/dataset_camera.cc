// Live cameras: camera:0, a pair camera:0,1, a stream rtsp://...; or videos in their stead: camera:FILE, a
// pipe. Frames come once, in order.
#include <algorithm>
#include <cctype>
#include <chrono>
#include <mutex>

#include "core/stopwatch.h"
#include "frontend/dataset/camera_input.h"
#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr const char* kPrefix = "camera:";

class CameraDataset : public RecordedDataset {
 public:
  CameraDataset(const std::string& name, const DatasetOptions& options)
      : RecordedDataset(name, options),
        device_(IsCameraDevice(name)),
        first_(Open(0)),
        second_(CameraSources(name).size() > 1 ? std::make_optional(Open(1)) : std::nullopt) {
    const std::vector<std::string> sources = CameraSources(name);
    const double rate = options.rate_hz > 0 ? options.rate_hz : first_.RateHz();
    rate_hz_ = rate > 0 && rate < 1e4 ? rate : 30.0;
    if (!Grab()) {
      const std::string problem =
          first_.Video() == nullptr ? "is it in use by another program?"
          : IsStream(name_)         ? "is it a stream of video?"
          : std::any_of(sources.begin(), sources.end(), IsPipe)
              ? "an MP4 whose index is at its end can't come through a pipe: send it with -f matroska"
              : "is it a complete video file?";
      throw InputError(name_ + ": " + (second_ ? first_.Source() + " " : std::string()) +
                       "delivers no image; " + problem);
    }
    CheckFirst(frames_.at(0));
    if (first_.Video() != nullptr)
      options_.camera = CameraOfVideo(name_, *first_.Video(), options_, size_, warnings_);
    SetUpRig(rate_hz_);
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
  int TurnedBy() const override { return first_.Video() != nullptr ? first_.Video()->TurnedBy() : 0; }

  ReadResult Read(std::size_t i) const override {
    ReadResult result;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const auto found = frames_.find(i);
      if (found == frames_.end()) {
        result.error = About(i) + " is gone; a camera's frames come once, in order";
        return result;
      }
      result = std::move(found->second);
      frames_.erase(frames_.begin(), std::next(found));
    }
    if (!result.frame) return result;
    if (result.frame->image.size() != size_) {
      result.frame.reset();
      result.error = About(i) + " has another size than the first";
      return result;
    }
    Rectify(result);
    result.frame->mask = mask_;
    return result;
  }

 private:
  bool SideBySide() const { return options_.sensor == Sensor::kStereo && !second_; }
  bool Depth() const { return options_.sensor == Sensor::kRgbd; }

  CameraInput Open(std::size_t which) const {
    const std::vector<std::string> sources = CameraSources(name_);
    DeviceMode mode;
    mode.rate_hz = options_.rate_hz;
    if (options_.camera && options_.camera->width > 0) {
      const bool both_in_one = options_.sensor == Sensor::kStereo && sources.size() == 1;
      mode.width = (both_in_one ? 2 : 1) * options_.camera->width;
      mode.height = options_.camera->height;
    }
    return {name_, sources[which], which == 1 && Depth() ? CameraContent::kDepth : CameraContent::kGrey,
            mode};
  }

  // Takes the size of all images. What is wrong from the beginning is not only said of each frame.
  void CheckFirst(const ReadResult& taken) {
    const InputFrame& frame = *taken.frame;
    size_ = frame.image.size();
    if (SideBySide() && frame.right.empty())
      throw InputError(name_ + ": with sensor stereo, one camera gives both images side by side, but " +
                       SizeText(size_) + " pixels have an odd width; give two cameras (LEFT,RIGHT)");
    if (SideBySide() && size_.width < size_.height)
      Warn("taken as two images of " + SizeText(size_) +
           " side by side, as sensor is stereo; for one image set it to mono");
    if (!second_) return;
    if (!taken.depth_error.empty()) throw InputError(taken.depth_error);
    const cv::Size second = Depth() ? frame.depth_m.size() : frame.right.size();
    if (second != size_)
      throw InputError(name_ + ": " + first_.Source() + " gives images of " + SizeText(size_) + ", " +
                       second_->Source() + " of " + SizeText(second) +
                       (Depth() ? "; depth must be registered to colour" : "; both must be equally large"));
  }

  // Takes the next image, or pair, into frames_; false at the end. Of one thread at a time.
  bool Grab() const {
    if (ended_) return false;
    const auto seconds = [&] { return since_begin_.Seconds(); };
    GrabbedPair grabbed;
    if (second_ && !second_ended_) {
      grabbed = GrabTogether(first_, *second_, 1 / rate_hz_, seconds);
    } else {
      grabbed = {first_.Grab(), false, seconds()};
    }
    ReadResult taken;
    InputFrame frame;
    if (!grabbed.first || !first_.Retrieve(frame.image).empty()) return false;
    if (second_) taken.depth_error = TakeSecond(grabbed.second, frame);
    if (SideBySide() && frame.image.cols % 2 == 0) {
      const int half = frame.image.cols / 2;
      frame.right = frame.image.colRange(half, 2 * half).clone();
      frame.image = frame.image.colRange(0, half).clone();
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    frame.stamp_s = StampOfNext(grabbed.first_s);
    if (!stamps_.empty() && frame.stamp_s < stamps_.back() - 0.5 && !device_) {
      ended_ = true;
      taken.error = StampsJumpBack(name_, stamps_.size(), stamps_.back(), frame.stamp_s);
    }
    if (!stamps_.empty() && frame.stamp_s <= stamps_.back()) frame.stamp_s = stamps_.back() + 1e-6;
    frame.index = static_cast<std::int64_t>(stamps_.size());
    stamps_.push_back(frame.stamp_s);
    if (taken.error.empty()) taken.frame = std::move(frame);
    frames_[stamps_.size() - 1] = std::move(taken);
    return true;
  }

  // A device's are seconds since 1970, by a clock that can't go back; a video has its own, unless the rate is
  // given. mutex_ is held.
  double StampOfNext(double grabbed_s) const {
    if (device_) return begin_s_ + grabbed_s;
    const double of_video = options_.rate_hz > 0 ? 0 : first_.TakenAt();
    return of_video > 0 ? of_video : static_cast<double>(stamps_.size()) / rate_hz_;
  }

  // The right or depth image of the frame that is next; or why there is none.
  std::string TakeSecond(bool grabbed, InputFrame& frame) const {
    const std::size_t i = Size();
    if (grabbed) return second_->Retrieve(Depth() ? frame.depth_m : frame.right);
    if (!second_ended_) second_ended_ = i;  // a device that was pulled out is not waited for again
    const std::string absent = About(i) + " has no " + (Depth() ? "depth" : "right") + " image: ";
    if (*second_ended_ == 0)
      return absent + second_->Source() + " delivers none" +
             (device_ ? "; is it in use by another program?" : "");
    return absent + second_->Source() + " ended after " + std::to_string(*second_ended_) + " images";
  }

  void Rectify(ReadResult& result) const {
    InputFrame& frame = *result.frame;
    cv::Mat& second = Depth() ? frame.depth_m : frame.right;
    if (!second.empty() && second.size() != size_) {
      result.depth_error = About(static_cast<std::size_t>(frame.index)) + ": its " +
                           (Depth() ? "depth" : "right") + " image has another size than the first";
      second.release();
    }
    frame.image = Rectified(rig_.left, frame.image);
    if (!frame.right.empty()) frame.right = Rectified(rig_.right, frame.right);
    if (frame.depth_m.empty()) return;
    const cv::Mat metres = DepthInMetres(frame.depth_m, DepthUnits(options_, 0), options_.max_depth_m);
    frame.depth_m = Rectified(rig_.left, metres, Sampling::kNearest);
  }

  bool device_ = false;
  double rate_hz_ = 30;
  const internal::Stopwatch since_begin_;
  const double begin_s_ =
      std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  mutable CameraInput first_;                        // the left, colour, or only one
  mutable std::optional<CameraInput> second_;        // the right one, or depth
  mutable std::optional<std::size_t> second_ended_;  // it gave so many images
  mutable bool ended_ = false;                       // what follows is another recording
  mutable std::mutex mutex_;
  mutable std::vector<double> stamps_;                // guarded by mutex_
  mutable std::map<std::size_t, ReadResult> frames_;  // not read yet, as taken; guarded by mutex_
};

bool IsNumber(const std::string& source) {
  return !source.empty() && source.size() < 5 &&
         std::all_of(source.begin(), source.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool AreNumbers(const std::vector<std::string>& sources) {
  return std::all_of(sources.begin(), sources.end(), IsNumber);
}

// At every comma; "a," has an empty one at its end.
std::vector<std::string> AtCommas(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ',')
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

std::string BehindPrefix(const std::string& name) { return name.substr(std::string(kPrefix).size()); }

void CheckSources(const std::string& name, const std::vector<std::string>& sources, Sensor sensor) {
  const std::string forms =
      "one camera, two for stereo (camera:LEFT,RIGHT), or two for RGB-D (camera:COLOUR,DEPTH)";
  if (std::count(sources.begin(), sources.end(), "") > 0)
    throw InputError(name + ": a camera has no name; give " + forms);
  if (sources.size() > 2)
    throw InputError(name + ": names " + std::to_string(sources.size()) + " cameras; give " + forms +
                     ". A file with a comma in its name can't be one of two: rename it");
  if (sources.size() == 2 && sensor == Sensor::kMono)
    throw InputError(name +
                     ": names two cameras, but sensor is mono; set sensor to stereo (LEFT,RIGHT) or "
                     "rgbd (COLOUR,DEPTH), or name one");
  if (sources.size() == 1 && sensor == Sensor::kRgbd)
    throw InputError(name + ": RGB-D needs two cameras, camera:COLOUR,DEPTH; the second gives 16-bit depth");
  if (sources.size() != 2) return;
  if (sources[0] == sources[1]) throw InputError(name + ": names the same camera twice; give " + forms);
  if (IsNumber(sources[0]) != IsNumber(sources[1]))
    throw InputError(name +
                     ": one is a device and one a file, whose images are not of the same time; give "
                     "two devices or two files");
}

}  // namespace

bool IsStream(const std::string& name) {
  constexpr std::array<const char*, 4> kSchemes = {"rtsp://", "rtsps://", "http://", "https://"};
  return std::any_of(kSchemes.begin(), kSchemes.end(),
                     [&](const char* scheme) { return name.rfind(scheme, 0) == 0; });
}

bool IsPipe(const std::string& name) {
  std::error_code ignored;
  if (name == "-") return !std::filesystem::is_regular_file("/dev/stdin", ignored);
  return std::filesystem::is_fifo(name, ignored);
}

bool IsCamera(const std::string& name) {
  return name.rfind(kPrefix, 0) == 0 || IsStream(name) || name == "-" || IsPipe(name);
}

bool IsCameraDevice(const std::string& name) {
  if (IsStream(name)) return true;
  return name.rfind(kPrefix, 0) == 0 && AreNumbers(AtCommas(BehindPrefix(name)));
}

std::vector<std::string> CameraSources(const std::string& name) {
  if (!IsCamera(name)) return {};
  if (name.rfind(kPrefix, 0) != 0) return {name};
  const std::string source = BehindPrefix(name);
  std::vector<std::string> parts = AtCommas(source);
  std::error_code ignored;
  if (!AreNumbers(parts) && std::filesystem::exists(source, ignored)) return {source};
  return parts;
}

std::unique_ptr<Dataset> OpenCamera(const std::string& name, const DatasetOptions& options) {
  CheckSources(name, CameraSources(name), options.sensor);
  return std::make_unique<CameraDataset>(name, options);
}

}  // namespace tutti
