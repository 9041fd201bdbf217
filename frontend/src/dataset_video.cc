// A video file. Decoders are sequential, so random access is emulated: frames that a reader thread skips over
// are kept for a while for its neighbours, and going far back starts from the beginning.
#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>

#include "dataset_folder.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

// FFmpeg and OpenCV's own motion JPEG; GStreamer only where OpenCV was built without FFmpeg.
std::vector<int> Backends() {
  const std::vector<cv::VideoCaptureAPIs> known = cv::videoio_registry::getBackends();
  const bool ffmpeg = std::find(known.begin(), known.end(), cv::CAP_FFMPEG) != known.end();
  return {ffmpeg ? cv::CAP_FFMPEG : cv::CAP_GSTREAMER, cv::CAP_OPENCV_MJPEG};
}

class VideoDataset : public Dataset {
 public:
  VideoDataset(std::filesystem::path file, const DatasetOptions& options)
      : file_(std::move(file)), options_(options) {
    Reopen();
    const double rate = options.rate_hz > 0 ? options.rate_hz : capture_.get(cv::CAP_PROP_FPS);
    rate_hz_ = rate > 0 && std::isfinite(rate) ? rate : 30.0;
    const double count = capture_.get(cv::CAP_PROP_FRAME_COUNT);
    if (count >= 1 && count < 1e9) {
      frames_ = static_cast<std::size_t>(count);
    } else {
      while (capture_.grab()) ++frames_;
      Reopen();
    }
    cv::Mat first;
    if (frames_ == 0 || !Next(first)) {
      throw InputError(file_.string() + ": no frame can be decoded; is it a complete video file?");
    }
    Keep(0, first);
    SetUpRig(first.size());
    frames_ =
        (frames_ + static_cast<std::size_t>(options.stride) - 1) / static_cast<std::size_t>(options.stride);
  }

  std::size_t Size() const override { return frames_; }
  double Stamp(std::size_t i) const override { return static_cast<double>(i) * options_.stride / rate_hz_; }
  const CameraRig& Rig() const override { return rig_; }
  std::optional<std::filesystem::path> GroundTruthFile() const override { return std::nullopt; }
  const std::vector<std::string>& Warnings() const override { return warnings_; }

  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override {
    const TrajectoryFormat format = GuessTrajectoryFormat(file);
    Trajectory poses = ReadTrajectory(file, format, warnings);
    if (format == TrajectoryFormat::kKitti) {
      if (poses.size() != frames_) {
        throw InputError(file.string() + ": has " + std::to_string(poses.size()) +
                         " poses, but the video has " + std::to_string(frames_) +
                         " frames; they must be as many");
      }
      for (std::size_t i = 0; i < poses.size(); ++i) poses[i].stamp_s = Stamp(i);
    }
    return poses;
  }

  ReadResult Read(std::size_t i) const override {
    ReadResult result;
    const std::size_t wanted = i * static_cast<std::size_t>(options_.stride);
    cv::Mat image;
    if (i < frames_) {
      const std::lock_guard<std::mutex> lock(mutex_);
      image = Fetch(wanted);
    }
    if (image.empty()) {
      result.error = file_.string() + ": frame " + std::to_string(wanted) + " can't be decoded";
      return result;
    }
    if (image.size() != size_) {
      result.error =
          file_.string() + ": frame " + std::to_string(wanted) + " has another size than the first";
      return result;
    }
    InputFrame frame;
    frame.index = static_cast<std::int64_t>(wanted);
    frame.stamp_s = Stamp(i);
    frame.image = rectifier_ ? rectifier_->Apply(image) : image;
    result.frame = std::move(frame);
    return result;
  }

 private:
  void SetUpRig(cv::Size size) {
    size_ = size;
    rig_.rate_hz = rate_hz_ / options_.stride;
    rig_.calibrated = options_.camera.has_value();
    if (options_.camera) {
      PinholeCamera camera = *options_.camera;
      if (camera.width == 0 && camera.height == 0) {
        camera.width = size.width;
        camera.height = size.height;
      }
      if (cv::Size(camera.width, camera.height) != size) {
        throw InputError(file_.string() +
                         ": the camera is calibrated for another image size than the video's " +
                         std::to_string(size.width) + "x" + std::to_string(size.height));
      }
      const std::string problem = camera.Validate();
      if (!problem.empty()) throw InputError(file_.string() + ": " + problem);
      rectifier_.emplace(camera);
      rig_.camera = rectifier_->Camera();
    } else {
      rig_.camera.width = size.width;
      rig_.camera.height = size.height;
      warnings_.push_back(file_.string() +
                          ": no calibration is given (camera: fx, fy, cx, cy); appearance only, no odometry");
    }
  }

  void Reopen() const {
    // Not CAP_ANY: it tries every backend, and each reports its failure at length on stderr.
    bool opened = false;
    for (const int backend : Backends()) {
      try {
        opened = capture_.open(file_.string(), backend);
      } catch (const cv::Exception&) {
        opened = false;
      }
      if (opened) break;
    }
    if (!opened) {
      throw InputError(file_.string() +
                       ": can't be opened as a video; is it complete and of a format that OpenCV decodes?");
    }
    next_ = 0;
  }

  bool Next(cv::Mat& grey) const {
    cv::Mat image;
    if (!capture_.read(image) || image.empty()) return false;
    ++next_;
    if (image.channels() == 1) {
      grey = image.clone();
    } else {
      cv::cvtColor(image, grey, image.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
    }
    return true;
  }

  void Keep(std::size_t at, const cv::Mat& image) const {
    constexpr std::size_t kKept = 48;
    kept_[at] = image;
    while (kept_.size() > kKept) kept_.erase(kept_.begin());
  }

  // Frame number `at` of the file, or an empty image. mutex_ is held.
  cv::Mat Fetch(std::size_t at) const {
    const auto found = kept_.find(at);
    if (found != kept_.end()) return found->second;
    if (at >= end_) return {};
    if (at < next_) {
      kept_.clear();
      try {
        Reopen();
      } catch (const InputError&) {
        return {};
      }
    }
    while (next_ <= at) {
      const std::size_t number = next_;
      cv::Mat image;
      bool good = false;
      try {
        good = Next(image);
      } catch (const cv::Exception&) {
        good = false;
      }
      if (!good) {
        end_ = number;
        return {};
      }
      Keep(number, image);
    }
    return kept_[at];
  }

  std::filesystem::path file_;
  DatasetOptions options_;
  CameraRig rig_;
  std::vector<std::string> warnings_;
  std::optional<Rectifier> rectifier_;
  double rate_hz_ = 30;
  std::size_t frames_ = 0;
  cv::Size size_;

  mutable std::mutex mutex_;  // guards all below
  mutable cv::VideoCapture capture_;
  mutable std::size_t next_ = 0;                            // number of the frame that the decoder gives next
  mutable std::size_t end_ = static_cast<std::size_t>(-1);  // where decoding failed
  mutable std::map<std::size_t, cv::Mat> kept_;
};

}  // namespace

std::unique_ptr<Dataset> OpenVideo(const std::filesystem::path& file, const DatasetOptions& options) {
  if (options.sensor != Sensor::kMono)
    throw InputError(file.string() + ": a video is mono; set sensor to mono");
  std::error_code code;
  if (std::filesystem::file_size(file, code) == 0 || code)
    throw InputError(file.string() + ": is empty or can't be read");
  return std::make_unique<VideoDataset>(file, options);
}

}  // namespace tutti
