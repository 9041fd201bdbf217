#include "apps/run/given_odometry.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "frontend/dataset/depth_reader.h"
#include "frontend/dataset/image_file.h"
#include "frontend/dataset/layout.h"
#include "frontend/dataset/wrapped_dataset.h"
#include "frontend/features/rectifier.h"
#include "tutti/backend/evaluation.h"
#include "tutti/backend/trajectory_file.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr double kLongestGap = 1.0;  // between poses that are interpolated [s]
constexpr double kSameTime = 0.02;   // of a pose and an image [s]

/// A data set that says in part something else than the one that it has.
class DatasetAround : public Dataset {
 public:
  explicit DatasetAround(std::unique_ptr<Dataset> images) : images_(std::move(images)) {}

  Supply FrameSupply() const override { return images_->FrameSupply(); }
  std::size_t Size() const override { return images_->Size(); }
  double Stamp(std::size_t i) const override { return images_->Stamp(i); }
  std::int64_t Number(std::size_t i) const override { return images_->Number(i); }
  ColourImage ReadColour(std::size_t i) const override { return images_->ReadColour(i); }
  double SkippedShare() const override { return images_->SkippedShare(); }
  const CameraRig& Rig() const override { return images_->Rig(); }
  std::optional<fs::path> GroundTruthFile() const override { return images_->GroundTruthFile(); }
  Trajectory ReadGroundTruth(const fs::path& file, std::vector<std::string>* warnings) const override {
    return images_->ReadGroundTruth(file, warnings);
  }
  const std::vector<std::string>& Warnings() const override { return images_->Warnings(); }

 protected:
  std::unique_ptr<Dataset> images_;
};

/// Other time stamps.
class RestampedDataset : public DatasetAround {
 public:
  RestampedDataset(std::unique_ptr<Dataset> images, std::vector<double> stamps)
      : DatasetAround(std::move(images)), stamps_(std::move(stamps)) {}

  double Stamp(std::size_t i) const override { return stamps_.at(static_cast<std::size_t>(Number(i))); }
  ReadResult Read(std::size_t i) const override {
    ReadResult read = images_->Read(i);
    if (read.frame) read.frame->stamp_s = Stamp(i);
    return read;
  }
  Trajectory ReadGroundTruth(const fs::path& file, std::vector<std::string>* warnings) const override {
    const PoseFile read = ReadPoseFile(file);
    if (read.has_stamps) return images_->ReadGroundTruth(file, warnings);
    return ReadPoseFile(file, read.format, stamps_).trajectory;
  }

 private:
  std::vector<double> stamps_;
};

/// One camera's images with registered depth that lies in a folder of its own: an RGB-D data set.
class DepthBeside : public DatasetAround {
 public:
  /// `stamps`: of all images of the folder, whatever part of them `images` has. Depth images are
  /// paired in the order of their names if there are as many, else by the stamps that they are called by
  /// (max_association_s). Throws InputError if neither works.
  DepthBeside(std::unique_ptr<Dataset> images, const std::vector<double>& stamps, const fs::path& depth,
              const DatasetOptions& options)
      : DatasetAround(std::move(images)),
        options_(options),
        rig_(images_->Rig()),
        warnings_(images_->Warnings()) {
    rig_.sensor = Sensor::kRgbd;
    rig_.max_depth_m = options.max_depth_m;
    if (options.camera && options.camera->distortion != Distortion::kNone) {
      const PinholeCamera stored = TurnedCamera(rig_.camera, (360 - options.rotate) % 360);
      PinholeCamera camera = *options.camera;  // of the images' size, as OpenDataset has checked
      camera.width = stored.width;
      camera.height = stored.height;
      rectifier_.emplace(camera);
    }
    std::vector<fs::path> found;
    for (RoleImage& image : ImagesOf(depth, {""})) found.push_back(std::move(image.file));
    if (found.empty()) throw InputError(depth.string() + ": holds no depth image (--depth)");
    const bool upright = options.rotate % 180 == 0;
    const cv::Size turned(rig_.camera.width, rig_.camera.height);
    reader_.emplace(options, DepthFormat(), options.camera,
                    upright ? turned : cv::Size(turned.height, turned.width));
    for (std::string& note : reader_->Notes(found.front())) warnings_.push_back(std::move(note));
    if (found.size() == stamps.size()) {
      files_ = found;
      return;
    }
    const auto named = StampsInNames(found).stamps;
    files_.resize(stamps.size());
    std::size_t alone = stamps.size();
    for (std::size_t i = 0; i < stamps.size() && !named.empty(); ++i) {
      const auto later = std::lower_bound(named.begin(), named.end(), stamps[i],
                                          [](const auto& stamp, double s) { return stamp.first < s; });
      auto nearest = later;
      if (later == named.end() ||
          (later != named.begin() && stamps[i] - (later - 1)->first < later->first - stamps[i]))
        nearest = later - 1;
      if (std::abs(nearest->first - stamps[i]) > options.max_association_s) continue;
      files_[i] = found[nearest->second];
      --alone;
    }
    if (alone == stamps.size())
      throw InputError(
          depth.string() + ": has " + std::to_string(found.size()) + " depth images for " +
          std::to_string(stamps.size()) +
          " images, and their names are no time stamps near those of the images; give as many, or "
          "name them by their time");
    if (alone > 0)
      warnings_.push_back(depth.string() + ": " + std::to_string(alone) + " of " +
                          std::to_string(stamps.size()) + " images have no depth image within " +
                          std::to_string(options.max_association_s) + " s");
  }

  /// With depth, or with depth_error.
  ReadResult Read(std::size_t i) const override {
    ReadResult result = images_->Read(i);
    if (!result.frame) return result;
    const fs::path& file = files_.at(static_cast<std::size_t>(Number(i)));
    if (file.empty()) return result;
    cv::Mat metres;
    result.depth_error = reader_->Read(file, rectifier_, metres);
    if (result.depth_error.empty()) result.frame->depth_m = TurnedImage(metres, options_.rotate);
    return result;
  }
  const CameraRig& Rig() const override { return rig_; }
  const std::vector<std::string>& Warnings() const override { return warnings_; }

 private:
  DatasetOptions options_;
  CameraRig rig_;
  std::optional<Rectifier> rectifier_;  // of a camera with distortion
  std::optional<DepthReader> reader_;
  std::vector<fs::path> files_;  // of each image; empty: none
  std::vector<std::string> warnings_;
};

// All images, whatever part of them is to be used.
DatasetOptions Whole(DatasetOptions options) {
  options.start = options.end = 0;
  options.stride = 1;
  options.noise = 0;
  return options;
}

bool HasOwnStamps(const fs::path& images, const DatasetOptions& options) {
  const DatasetType type = TypeToOpen(images, options);
  if (type == DatasetType::kPaired) return HasStamps(images);
  return type != DatasetType::kImages && type != DatasetType::kVideo;
}

bool Grows(const std::vector<double>& stamps) {
  return std::adjacent_find(stamps.begin(), stamps.end(), std::greater_equal<>()) == stamps.end();
}

Trajectory::const_iterator NotBefore(const Trajectory& trajectory, double stamp_s) {
  return std::lower_bound(trajectory.begin(), trajectory.end(), stamp_s,
                          [](const StampedPose& pose, double s) { return pose.stamp_s < s; });
}

PoseFile ReadPoses(const GivenOdometryFiles& files, const std::vector<double>& times) {
  std::optional<PoseFileFormat> format;
  if (files.format != "auto") format = ParsePoseFileFormat(files.format);
  return ReadPoseFile(files.trajectory, format, times);
}

}  // namespace

GivenOdometry::GivenOdometry(const GivenOdometryFiles& files, const fs::path& images,
                             const DatasetOptions& options)
    : files_(files), images_(images), options_(options) {
  if (files.depth) {
    if (DetectDatasetType(images) != DatasetType::kImages)
      throw InputError(
          images.string() +
          ": --depth goes with a plain folder of images; this one says itself where its depth is");
    options_.type = DatasetType::kImages;
    options_.sensor = Sensor::kMono;  // what a plain folder is
  }
  PoseFile poses = ReadPoses(files, {});
  if (poses.format == PoseFileFormat::kG2o)
    throw InputError(files.trajectory.string() + ": is a graph; a trajectory (TUM, KITTI, EuRoC) is needed");
  if (poses.trajectory.empty()) throw InputError(files.trajectory.string() + ": holds no pose");
  const std::unique_ptr<Dataset> all = OpenDataset(images, Whole(options_));
  std::vector<double> times;
  if (files.times) times = ReadTimes(*files.times, &notes_);
  const bool own = HasOwnStamps(images, options_);
  if (files.times && times.size() != all->Size() &&
      (poses.has_stamps || times.size() != poses.trajectory.size()))
    throw InputError(files.times->string() + ": has " + std::to_string(times.size()) + " time stamps, but " +
                     images.string() + " has " + std::to_string(all->Size()) + " images and " +
                     files.trajectory.string() + " " + std::to_string(poses.trajectory.size()) +
                     " poses; one for each image is needed");
  if (!poses.has_stamps && times.size() == poses.trajectory.size()) poses = ReadPoses(files, times);
  if (!HasRotations(poses.trajectory))
    throw InputError(
        files.trajectory.string() +
        ": has positions alone; an odometry needs rotations, too (TUM: stamp tx ty tz qx qy qz qw)");
  trajectory_ = poses.trajectory;
  has_stamps_ = poses.has_stamps || (files.times && times.size() == trajectory_.size());
  if (!own) {
    stamps_ = ImageStamps(*all, !has_stamps_ && poses.has_numbers);
  } else if (files.times && times.size() == all->Size() && has_stamps_ &&
             times.size() != trajectory_.size()) {
    stamps_ = times;
  }
  if (!has_stamps_) {
    StampByOrder(poses.has_numbers, *all);
  } else if (all->Size() > 0) {
    const bool of_all = stamps_.empty();
    AgreeOnUnit(of_all ? all->Stamp(0) : stamps_.front(),
                of_all ? all->Stamp(all->Size() - 1) : stamps_.back(), poses);
    trajectory_ = poses.trajectory;
  }
  notes_.insert(notes_.end(), poses.warnings.begin(), poses.warnings.end());
  jumps_ = FindJumps(trajectory_);
  for (const OdometryJump& jump : jumps_) {
    if (jump.comes_back) notes_.push_back(files.trajectory.string() + ": " + Sentence(jump));
  }
  as_given_ = trajectory_;
  trajectory_ = WithoutOutliers(std::move(trajectory_), jumps_);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const MotionSigma& sigma :
       files.sigmas ? ReadMotionSigmas(*files.sigmas, trajectory_) : poses.sigmas) {
    if (!variances_.empty()) sum += Eigen::Vector2d(sigma.translation_m, sigma.rotation_rad).cwiseAbs2();
    variances_.push_back(sum);
  }
}

// Lines have no stamps: one for each image, in order, or the images that they number.
void GivenOdometry::StampByOrder(bool numbered, const Dataset& all) {
  const auto stamp = [&](std::size_t i) { return stamps_.empty() ? all.Stamp(i) : stamps_[i]; };
  if (numbered) {
    for (StampedPose& pose : trajectory_) {
      const auto number = static_cast<std::size_t>(pose.stamp_s);
      if (number >= all.Size())
        throw InputError(files_.trajectory.string() + ": numbers a frame " + std::to_string(number) +
                         ", but " + images_.string() + " has " + std::to_string(all.Size()) +
                         " images; give the times of the frames (--times)");
      pose.stamp_s = stamp(number);
    }
    return;
  }
  if (trajectory_.size() != all.Size())
    throw InputError(files_.trajectory.string() + ": has no time stamps, and " +
                     std::to_string(trajectory_.size()) + " poses for " + std::to_string(all.Size()) +
                     " images; give the times of the poses (--times)");
  for (std::size_t i = 0; i < trajectory_.size(); ++i) trajectory_[i].stamp_s = stamp(i);
}

Eigen::Vector2d GivenOdometry::Variance(double stamp_s) const {
  const auto later = NotBefore(trajectory_, stamp_s);
  if (later == trajectory_.begin()) return variances_.front();
  if (later == trajectory_.end()) return variances_.back();
  const auto i = static_cast<std::size_t>(later - trajectory_.begin());
  const double begin_s = trajectory_[i - 1].stamp_s;
  const double share = (stamp_s - begin_s) / (trajectory_[i].stamp_s - begin_s);
  return variances_[i - 1] + share * (variances_[i] - variances_[i - 1]);
}

std::optional<MotionSigma> GivenOdometry::SigmaBetween(double from_s, double to_s) const {
  if (variances_.empty()) return std::nullopt;
  const Eigen::Vector2d sigma = (Variance(to_s) - Variance(from_s)).cwiseMax(0).cwiseSqrt();
  return MotionSigma{sigma[0], sigma[1]};
}

std::vector<double> GivenOdometry::ImageStamps(const Dataset& all, bool numbered) {
  const std::size_t count = all.Size();
  std::vector<fs::path> places;
  if (files_.times) places.push_back(*files_.times);
  const fs::path folder = fs::absolute(images_).lexically_normal() / "";
  for (const fs::path& above : {folder.parent_path(), folder.parent_path().parent_path()}) {
    std::error_code code;
    if (fs::is_regular_file(above / "times.txt", code)) places.push_back(above / "times.txt");
  }
  for (const fs::path& place : places) {
    std::vector<std::string> unit;
    std::vector<double> times = ReadTimes(place, &unit);
    if (times.size() != count) continue;
    if (!Grows(times)) throw InputError(place.string() + ": the time stamps must grow from line to line");
    notes_.push_back("the images have the time stamps of " + place.string());
    if (!files_.times) notes_.insert(notes_.end(), unit.begin(), unit.end());
    return times;
  }
  std::vector<double> stamps;
  for (std::size_t i = 0; i < count; ++i) stamps.push_back(all.Stamp(i));
  std::error_code ignored;
  if (fs::is_directory(images_, ignored) && StampsInNames(ListImages(images_)).stamps.size() == count)
    return stamps;  // of the names, which the data set says
  if (numbered) return stamps;
  if (trajectory_.size() != count && has_stamps_ && TypeToOpen(images_, options_) == DatasetType::kVideo) {
    notes_.push_back("the frames have the time stamps of the video");
    return stamps;
  }
  if (trajectory_.size() != count)
    throw InputError(images_.string() + ": nothing says when its " + std::to_string(count) +
                     " images were taken, and " + files_.trajectory.string() + " has " +
                     std::to_string(trajectory_.size()) +
                     " poses; give one time stamp for each image (--times FILE)");
  notes_.push_back("each image has the pose of the same place in the file, since there are as many");
  for (std::size_t i = 0; has_stamps_ && i < count; ++i) stamps[i] = trajectory_[i].stamp_s;
  return stamps;
}

std::unique_ptr<Dataset> GivenOdometry::Open() const {
  std::unique_ptr<Dataset> dataset = OpenDataset(images_, options_);
  if (!stamps_.empty()) dataset = std::make_unique<RestampedDataset>(std::move(dataset), stamps_);
  if (files_.depth)
    dataset = std::make_unique<DepthBeside>(std::move(dataset), stamps_, *files_.depth, options_);
  for (std::size_t i = 0; i < dataset->Size(); ++i) {
    if (At(dataset->Stamp(i))) return dataset;
  }
  throw InputError(files_.trajectory.string() + ": has no pose for any image: it is from " +
                   std::to_string(trajectory_.front().stamp_s) + " s to " +
                   std::to_string(trajectory_.back().stamp_s) + " s, the images from " +
                   std::to_string(dataset->Stamp(0)) + " s to " +
                   std::to_string(dataset->Stamp(dataset->Size() - 1)) +
                   " s; check the unit and the clock (--times gives the images' stamps)");
}

std::optional<Pose> GivenOdometry::At(double stamp_s) const {
  const auto later = NotBefore(trajectory_, stamp_s);
  if (later != trajectory_.end() && later->stamp_s - stamp_s < 1e-6) return later->pose;
  if (auto pose = InterpolatePose(trajectory_, stamp_s, kLongestGap)) return pose;
  auto nearest = later;
  if (later == trajectory_.end() ||
      (later != trajectory_.begin() && stamp_s - (later - 1)->stamp_s < later->stamp_s - stamp_s))
    nearest = later - 1;
  if (std::abs(nearest->stamp_s - stamp_s) > kSameTime) return std::nullopt;
  return nearest->pose;
}

}  // namespace tutti
