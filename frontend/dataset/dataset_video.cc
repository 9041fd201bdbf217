// A video file. Decoders are sequential, so random access is emulated: frames that a reader thread skips over
// are kept for a while for its neighbours, and going far back starts from the beginning.
#include <cmath>
#include <map>
#include <mutex>

#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/video_input.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

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
    size_ = first.size();
    rig_ = SingleCameraRig(options, size_, rate_hz_, file_.string(), rectifier_, warnings_);
  }

  std::size_t Size() const override { return frames_; }
  double Stamp(std::size_t i) const override { return static_cast<double>(i) / rate_hz_; }
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
    cv::Mat image;
    if (i < frames_) {
      const std::lock_guard<std::mutex> lock(mutex_);
      image = Fetch(i);
    }
    if (image.empty()) {
      result.error = file_.string() + ": frame " + std::to_string(i) + " can't be decoded";
      return result;
    }
    if (image.size() != size_) {
      result.error = file_.string() + ": frame " + std::to_string(i) + " has another size than the first";
      return result;
    }
    InputFrame frame;
    frame.index = static_cast<std::int64_t>(i);
    frame.stamp_s = Stamp(i);
    frame.image = rectifier_ ? rectifier_->Apply(image) : image;
    result.frame = std::move(frame);
    return result;
  }

 private:
  void Reopen() const {
    OpenVideoFile(file_, capture_);
    next_ = 0;
  }

  bool Next(cv::Mat& grey) const {
    if (!ReadGreyFrame(capture_, grey)) return false;
    ++next_;
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
