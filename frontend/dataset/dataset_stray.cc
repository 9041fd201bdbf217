// Stray Scanner (iPhone): rgb.mp4, camera_matrix.csv, odometry.csv, depth/*.png in millimetres, smaller than
// the video's images and of the same view. https://docs.strayrobots.io/apps/scanner/format.html
#include <cmath>

#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

class StrayDataset : public Dataset {
 public:
  StrayDataset(const fs::path& folder, const DatasetOptions& options)
      : folder_(folder), truth_{folder / "odometry.csv", TruthForm::kOdometry, {}, {}} {
    if (options.sensor == Sensor::kStereo)
      throw InputError(folder.string() + ": Stray Scanner records one camera; set sensor to rgbd or mono");
    DatasetOptions of_video = options;
    of_video.sensor = Sensor::kMono;
    std::error_code ignored;
    const fs::path matrix = folder / "camera_matrix.csv";
    const bool own = !options.camera && fs::is_regular_file(matrix, ignored);
    if (own) of_video.camera = ReadIntrinsics(matrix);
    video_ = OpenVideo(folder / "rgb.mp4", of_video);
    warnings_ = video_->Warnings();
    rig_ = video_->Rig();
    const cv::Size size(rig_.camera.width, rig_.camera.height);
    if (own && std::abs(2 * of_video.camera->cx / size.width - 1) > 0.2)
      throw InputError(matrix.string() + ": is not of images of " + SizeText(size) +
                       ", as those of rgb.mp4 are; give the camera (--camera fx,fy,cx,cy)");
    FindStamps();
    if (options.sensor != Sensor::kRgbd) return;
    rig_.sensor = Sensor::kRgbd;
    rig_.max_depth_m = options.max_depth_m;
    rig_.depth_delay_s = options.depth_delay_s;
    FindDepth(options, of_video.camera, size);
  }

  std::size_t Size() const override { return numbers_.size(); }
  double Stamp(std::size_t i) const override { return stamps_.at(i); }
  ReadResult Read(std::size_t i) const override {
    ReadResult result = video_->Read(numbers_.at(i));
    if (!result.frame) return result;
    result.frame->index = static_cast<std::int64_t>(i);
    result.frame->stamp_s = stamps_[i];
    if (!reader_ || depth_[i].empty()) return result;
    try {
      result.depth_error = reader_->Read(depth_[i], rectifier_, result.frame->depth_m);
    } catch (const std::exception& e) {
      result.depth_error = depth_[i].string() + ": can't be used: " + e.what();
    }
    return result;
  }
  ColourImage ReadColour(std::size_t i) const override { return video_->ReadColour(numbers_.at(i)); }
  const CameraRig& Rig() const override { return rig_; }
  std::optional<fs::path> GroundTruthFile() const override {
    return HoldsTruth(truth_) ? std::optional<fs::path>(truth_.place) : std::nullopt;
  }
  Trajectory ReadGroundTruth(const fs::path& file, std::vector<std::string>* warnings) const override {
    std::error_code code;
    if (fs::equivalent(file, truth_.place, code)) return ReadLayoutTruth(truth_, warnings);
    return video_->ReadGroundTruth(file, warnings);
  }
  const std::vector<std::string>& Warnings() const override { return warnings_; }

 private:
  // The lines of odometry.csv have stamps and name their frames; without it, the video's own are used.
  void FindStamps() {
    std::error_code ignored;
    if (!fs::is_regular_file(truth_.place, ignored)) {
      for (std::size_t i = 0; i < video_->Size(); ++i) {
        numbers_.push_back(i);
        stamps_.push_back(video_->Stamp(i));
      }
      return;
    }
    StampOrder order(truth_.place, warnings_);
    for (const TextLine& line : ReadTextLines(truth_.place)) {
      if (line.words.front() == "timestamp") continue;
      const double stamp = NumberAt(truth_.place, line, 0), number = NumberAt(truth_.place, line, 1);
      if (!(number >= 0 && number < static_cast<double>(video_->Size()))) continue;  // the video ended
      const auto frame = static_cast<std::size_t>(number);
      if (!numbers_.empty() && frame <= numbers_.back())
        throw InputError(At(truth_.place, line.number) + "its frame does not follow that of the line before");
      if (!order.Accept(line.number, stamp)) continue;
      numbers_.push_back(frame);
      stamps_.push_back(stamp);
    }
    if (numbers_.empty()) throw InputError(truth_.place.string() + ": has no line for a frame of rgb.mp4");
    if (numbers_.size() < video_->Size())
      warnings_.push_back(truth_.place.string() + ": has no line for " +
                          std::to_string(video_->Size() - numbers_.size()) + " of " +
                          std::to_string(video_->Size()) + " frames of rgb.mp4, which are left out");
    if (stamps_.size() > 1)
      rig_.rate_hz = static_cast<double>(stamps_.size() - 1) / (stamps_.back() - stamps_.front());
  }

  void FindDepth(const DatasetOptions& options, const std::optional<PinholeCamera>& camera, cv::Size size) {
    DepthFormat format;
    format.units_per_m = 1000;
    format.same_view = true;
    reader_.emplace(options, format, camera, size);
    if (camera && camera->distortion != Distortion::kNone) {
      PinholeCamera sized = *camera;
      sized.width = size.width;
      sized.height = size.height;
      rectifier_.emplace(sized);
    }
    std::map<std::string, fs::path> files;
    for (const RoleImage& image : ImagesOf(folder_, {"depth"})) files.emplace(image.key, image.file);
    std::size_t alone = 0;
    for (const std::size_t number : numbers_) {
      const auto found = files.find(std::to_string(number));
      depth_.push_back(found == files.end() ? fs::path() : found->second);
      if (found == files.end()) ++alone;
    }
    if (alone == numbers_.size())
      throw InputError((folder_ / "depth").string() +
                       ": holds no depth image with the number of a frame of rgb.mp4; set sensor to mono");
    if (alone > 0)
      warnings_.push_back((folder_ / "depth").string() + ": " + std::to_string(alone) + " of " +
                          std::to_string(numbers_.size()) + " frames have no depth image");
  }

  fs::path folder_;
  LayoutTruth truth_;
  std::unique_ptr<Dataset> video_;
  CameraRig rig_;
  std::vector<std::string> warnings_;
  std::vector<std::size_t> numbers_;  // of the frames that are used, in the video
  std::vector<double> stamps_;
  std::vector<fs::path> depth_;  // of each; empty: none
  std::optional<DepthReader> reader_;
  std::optional<Rectifier> rectifier_;
};

}  // namespace

std::unique_ptr<Dataset> OpenStrayScanner(const fs::path& folder, const DatasetOptions& options) {
  return std::make_unique<StrayDataset>(folder, options);
}

}  // namespace tutti
