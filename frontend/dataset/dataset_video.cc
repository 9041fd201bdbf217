// A video file. Decoders are sequential, so random access is emulated: frames that a reader thread skips over
// are kept for a while for its neighbours, and going far back starts from the beginning.
#include <algorithm>
#include <mutex>
#include <set>

#include "core/text_reader.h"
#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/video_decoder.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

/// The times of a video's frames.
struct VideoTimes {
  std::vector<std::int64_t> ticks;  ///< of the container, growing; empty: it has none
  std::vector<double> stamps_s;     ///< from the first frame on
  std::vector<std::string> notes;
  double skipped_share = 0;  ///< Dataset::SkippedShare
};

// Equal times are one frame's: what is shown at once is not seen apart.
void DropRepeated(const std::string& name, VideoTimes& times) {
  const std::size_t all = times.ticks.size();
  times.ticks.erase(std::unique(times.ticks.begin(), times.ticks.end()), times.ticks.end());
  const std::size_t skipped = all - times.ticks.size();
  if (skipped == 0) return;
  times.notes.push_back(name + ": " + PartText(skipped, all) + " frames repeat a time stamp and are skipped");
  times.skipped_share = static_cast<double>(skipped) / static_cast<double>(all);
}

// By decoding all of it. `listed`: when its frames are to be decoded, for containers that say no more (AVI).
VideoTimes DecodedTimes(const std::string& name, const std::vector<std::int64_t>& listed, double rate_hz) {
  VideoTimes out;
  VideoDecoder video(name);
  std::size_t frames = 0;
  for (bool all = true; video.Grab(); ++frames) {
    const std::optional<std::int64_t> ticks = video.Ticks();
    all = all && ticks;
    if (!all) {
      out.ticks.clear();
      continue;
    }
    if (!out.ticks.empty() && *ticks < out.ticks.back())
      throw InputError(StampsJumpBack(name, frames, video.Seconds(out.ticks.back()), video.Seconds(*ticks)));
    out.ticks.push_back(*ticks);
  }
  DropRepeated(name, out);
  if (!out.ticks.empty() || frames == 0) return out;
  const bool grows = std::adjacent_find(listed.begin(), listed.end(), std::greater_equal<>()) == listed.end();
  const bool use_listed = grows && listed.size() == frames;
  for (std::size_t i = 0; i < frames; ++i)
    out.stamps_s.push_back(use_listed ? video.Seconds(listed[i] - listed[0])
                                      : static_cast<double>(i) / rate_hz);
  out.notes.push_back(
      name + (use_listed ? ": says when frames are decoded, and not when they are shown; those times are used"
                         : ": has no time stamps; " + std::to_string(rate_hz) +
                               " frames a second are assumed (dataset.rate_hz)"));
  return out;
}

// By the container's list of frames, if the first frame that can be decoded is among them.
VideoTimes TimesOf(const std::string& name, std::optional<std::int64_t> first, double rate_hz) {
  VideoTimes out;
  VideoDecoder video(name);
  VideoDecoder::Listed listed = video.List();
  out.ticks = std::move(listed.shown);
  const auto begin = first ? std::find(out.ticks.begin(), out.ticks.end(), *first) : out.ticks.end();
  if (begin == out.ticks.end()) {
    out = DecodedTimes(name, listed.decoded, rate_hz);
  } else {
    if (begin != out.ticks.begin())
      out.notes.push_back(name + ": the first " + std::to_string(begin - out.ticks.begin()) +
                          " frames can't be decoded and are left out: the video was cut before them");
    out.ticks.erase(out.ticks.begin(), begin);
    DropRepeated(name, out);
  }
  for (const std::int64_t ticks : out.ticks) out.stamps_s.push_back(video.Seconds(ticks - out.ticks.front()));
  return out;
}

/// The frames of a file by their number. Safe from several threads.
class VideoFrames {
 public:
  /// `kept`: so many that were decoded last can be had again at once.
  VideoFrames(std::string file, Pixels pixels, std::size_t kept)
      : file_(std::move(file)), pixels_(pixels), most_kept_(kept) {}

  /// Frame number `at`, whose times are these, or an empty image where it can't be decoded.
  cv::Mat Fetch(std::size_t at, const std::vector<std::int64_t>& ticks) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = kept_.find(at);
    if (found != kept_.end()) return found->second;
    if (absent_.count(at) > 0) return {};
    if ((!video_ || at < next_) && !Reopen()) return {};
    while (next_ <= at && video_->Grab()) {
      const std::optional<std::size_t> number = NumberOf(ticks);
      if (!number || *number < next_) continue;  // repeats a time
      for (; next_ < *number; ++next_) absent_.insert(next_);
      ++next_;
      if (*number + most_kept_ <= at) continue;  // on the way there
      kept_[*number] = video_->Retrieve(pixels_);
      while (kept_.size() > most_kept_) kept_.erase(kept_.begin());
    }
    if (next_ <= at) absent_.insert(at);
    const auto got = kept_.find(at);
    return got != kept_.end() ? got->second : cv::Mat();
  }

 private:
  // The frame is that which was grabbed last; nothing: the container does not list it.
  std::optional<std::size_t> NumberOf(const std::vector<std::int64_t>& ticks) const {
    const std::optional<std::int64_t> here = video_->Ticks();
    if (ticks.empty() || !here) return next_;
    const auto place = std::lower_bound(ticks.begin(), ticks.end(), *here);
    if (place == ticks.end() || *place != *here) return std::nullopt;
    return static_cast<std::size_t>(place - ticks.begin());
  }

  bool Reopen() const {
    kept_.clear();
    next_ = 0;
    try {
      video_.emplace(file_);
    } catch (const InputError&) {  // it is gone
      video_.reset();
      return false;
    }
    return true;
  }

  const std::string file_;
  const Pixels pixels_;
  const std::size_t most_kept_;
  mutable std::mutex mutex_;  // guards all below
  mutable std::optional<VideoDecoder> video_;
  mutable std::size_t next_ = 0;          // the first number that was not decoded
  mutable std::set<std::size_t> absent_;  // numbers that can't be decoded
  mutable std::map<std::size_t, cv::Mat> kept_;
};

class VideoDataset : public RecordedDataset {
 public:
  VideoDataset(const std::filesystem::path& file, const DatasetOptions& options)
      : RecordedDataset(file.string(), options),
        grey_(name_, Pixels::kGrey, 48),
        colour_(name_, Pixels::kColour, 2) {
    VideoDecoder video(name_);
    const cv::Mat first = video.Grab() ? video.Retrieve(Pixels::kGrey) : cv::Mat();
    if (first.empty()) throw InputError(name_ + ": no frame can be decoded; is it a complete video file?");
    size_ = first.size();
    const double stated_hz = options.rate_hz > 0  ? options.rate_hz
                             : video.RateHz() > 0 ? video.RateHz()
                                                  : 30.0;
    VideoTimes times = TimesOf(name_, video.Ticks(), stated_hz);
    ticks_ = std::move(times.ticks);
    stamps_s_ = std::move(times.stamps_s);
    warnings_ = std::move(times.notes);
    skipped_share_ = times.skipped_share;
    if (options.rate_hz > 0) {
      for (std::size_t i = 0; i < stamps_s_.size(); ++i)
        stamps_s_[i] = static_cast<double>(i) / options.rate_hz;
    }
    turned_by_ = video.TurnedBy();
    options_.camera = CameraOfVideo(name_, video, options, size_, warnings_);
    SetUpRig(stated_hz);
  }

  std::size_t Size() const override { return stamps_s_.size(); }
  double Stamp(std::size_t i) const override { return stamps_s_.at(i); }
  double SkippedShare() const override { return skipped_share_; }
  int TurnedBy() const override { return turned_by_; }

  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override {
    TrajectoryDetails details;
    const Trajectory poses = ReadTrajectory(file, GuessTrajectoryFormat(file), warnings, &details);
    if (details.has_stamps) return poses;
    std::vector<std::pair<std::int64_t, double>> frames;
    for (std::size_t i = 0; i < Size(); ++i) frames.emplace_back(i, Stamp(i));
    return StampedByFrame(file, poses, details, Size(), frames);
  }

  ReadResult Read(std::size_t i) const override {
    ReadResult result;
    InputFrame frame;
    result.error = Fetch(grey_, i, frame.image);
    if (!result.error.empty()) return result;
    frame.index = static_cast<std::int64_t>(i);
    frame.stamp_s = Stamp(i);
    frame.mask = mask_;
    result.frame = std::move(frame);
    return result;
  }

  ColourImage ReadColour(std::size_t i) const override {
    ColourImage result;
    result.error = Fetch(colour_, i, result.image);
    return result;
  }

 private:
  // What is wrong with frame i; else `out` gets it.
  std::string Fetch(const VideoFrames& frames, std::size_t i, cv::Mat& out) const {
    const cv::Mat image = i < Size() ? frames.Fetch(i, ticks_) : cv::Mat();
    if (image.empty()) return About(i) + " can't be decoded";
    if (image.size() != size_) return About(i) + " has another size than the first";
    out = Rectified(rig_.left, image);
    return {};
  }

  VideoFrames grey_, colour_;
  std::vector<std::int64_t> ticks_;  // of the frames, as VideoTimes has them
  std::vector<double> stamps_s_;
  int turned_by_ = 0;
  double skipped_share_ = 0;
};

}  // namespace

std::unique_ptr<Dataset> OpenVideo(const std::filesystem::path& file, const DatasetOptions& options) {
  internal::RequireFile(file, "give a video file");
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
