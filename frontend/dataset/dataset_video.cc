// A video file. Decoders are sequential, so random access is emulated: frames that a reader thread skips over
// are kept for a while for its neighbours, and going far back starts from the beginning.
#include <cmath>
#include <map>
#include <mutex>

#include "core/text_reader.h"
#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/video_input.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

/// The frames of a file by their number. Safe from several threads.
class VideoFrames {
 public:
  /// `decode` reads the next one of a capture; `kept`: so many that were decoded last can be had again at
  /// once.
  VideoFrames(std::filesystem::path file, bool (*decode)(cv::VideoCapture&, cv::Mat&), std::size_t kept)
      : file_(std::move(file)), decode_(decode), most_kept_(kept) {}

  /// Frame number `at` of the file, or an empty image where it can't be decoded.
  cv::Mat Fetch(std::size_t at) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = kept_.find(at);
    if (found != kept_.end()) return found->second;
    if (at >= end_) return {};
    if ((at < next_ || !capture_.isOpened()) && !Reopen()) return {};
    while (next_ <= at) {
      const std::size_t number = next_;
      cv::Mat image;
      bool good = false;
      try {
        good = decode_(capture_, image);
      } catch (const cv::Exception&) {
        good = false;
      }
      if (!good) {
        end_ = number;
        return {};
      }
      ++next_;
      kept_[number] = image;
      while (kept_.size() > most_kept_) kept_.erase(kept_.begin());
    }
    return kept_[at];
  }

 private:
  bool Reopen() const {
    kept_.clear();
    next_ = 0;
    try {
      OpenVideoFile(file_, capture_);
    } catch (const InputError&) {
      return false;
    }
    return true;
  }

  const std::filesystem::path file_;
  bool (*const decode_)(cv::VideoCapture&, cv::Mat&);
  const std::size_t most_kept_;
  mutable std::mutex mutex_;  // guards all below
  mutable cv::VideoCapture capture_;
  mutable std::size_t next_ = 0;                            // number of the frame that the decoder gives next
  mutable std::size_t end_ = static_cast<std::size_t>(-1);  // where decoding failed
  mutable std::map<std::size_t, cv::Mat> kept_;
};

class VideoDataset : public Dataset {
 public:
  VideoDataset(const std::filesystem::path& file, const DatasetOptions& options)
      : file_(file), grey_(file, ReadGreyFrame, 48), colour_(file, ReadColourFrame, 2) {
    cv::VideoCapture capture;
    OpenVideoFile(file_, capture);
    const double rate = options.rate_hz > 0 ? options.rate_hz : capture.get(cv::CAP_PROP_FPS);
    rate_hz_ = rate > 0 && std::isfinite(rate) ? rate : 30.0;
    const double count = capture.get(cv::CAP_PROP_FRAME_COUNT);
    if (count >= 1 && count < 1e9) {
      frames_ = static_cast<std::size_t>(count);
    } else {
      while (capture.grab()) ++frames_;
    }
    const cv::Mat first = frames_ > 0 ? grey_.Fetch(0) : cv::Mat();
    if (first.empty())
      throw InputError(file_.string() + ": no frame can be decoded; is it a complete video file?");
    size_ = first.size();
    rig_ = RectifyRig(file_.string(), options, size_, rate_hz_, warnings_);
    mask_ = MaskOfAll(options, size_, rig_.left);
  }

  std::size_t Size() const override { return frames_; }
  double Stamp(std::size_t i) const override { return static_cast<double>(i) / rate_hz_; }
  const CameraRig& Rig() const override { return rig_.rig; }
  std::optional<std::filesystem::path> GroundTruthFile() const override { return std::nullopt; }
  const std::vector<std::string>& Warnings() const override { return warnings_; }

  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override {
    TrajectoryDetails details;
    const Trajectory poses = ReadTrajectory(file, GuessTrajectoryFormat(file), warnings, &details);
    if (details.has_stamps) return poses;
    std::vector<std::pair<std::int64_t, double>> frames;
    for (std::size_t i = 0; i < frames_; ++i) frames.emplace_back(i, Stamp(i));
    return StampedByFrame(file, poses, details, frames_, frames);
  }

  ReadResult Read(std::size_t i) const override {
    ReadResult result;
    InputFrame frame;
    result.error = Rectified(grey_, i, frame.image);
    if (!result.error.empty()) return result;
    frame.index = static_cast<std::int64_t>(i);
    frame.stamp_s = Stamp(i);
    frame.mask = mask_;
    result.frame = std::move(frame);
    return result;
  }

  ColourImage ReadColour(std::size_t i) const override {
    ColourImage result;
    result.error = Rectified(colour_, i, result.image);
    return result;
  }

 private:
  // What is wrong with frame i; else `out` gets it.
  std::string Rectified(const VideoFrames& frames, std::size_t i, cv::Mat& out) const {
    const cv::Mat image = i < frames_ ? frames.Fetch(i) : cv::Mat();
    if (image.empty()) return file_.string() + ": frame " + std::to_string(i) + " can't be decoded";
    if (image.size() != size_)
      return file_.string() + ": frame " + std::to_string(i) + " has another size than the first";
    out = rig_.left ? rig_.left->Apply(image) : image;
    return {};
  }

  std::filesystem::path file_;
  VideoFrames grey_, colour_;
  RectifiedRig rig_;
  std::vector<std::string> warnings_;
  double rate_hz_ = 30;
  std::size_t frames_ = 0;
  cv::Size size_;
  cv::Mat mask_;
};

}  // namespace

std::unique_ptr<Dataset> OpenVideo(const std::filesystem::path& file, const DatasetOptions& options) {
  internal::RequireFile(
      file, "give a video file (a pipe that somebody writes a video to: camera:" + file.string() + ")");
  if (options.sensor != Sensor::kMono)
    throw InputError(
        file.string() +
        ": a video is mono; set sensor to mono (camera:FILE takes a side-by-side video as stereo, "
        "camera:LEFT,RIGHT two)");
  std::error_code code;
  if (std::filesystem::file_size(file, code) == 0 || code)
    throw InputError(file.string() + ": is empty or can't be read");
  return std::make_unique<VideoDataset>(file, options);
}

}  // namespace tutti
