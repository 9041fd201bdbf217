// What the readers of image folders share: a list of frames, rectifiers, ground truth.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "frontend/dataset/depth_reader.h"
#include "frontend/dataset/image_file.h"
#include "frontend/dataset/image_mask.h"
#include "frontend/dataset/layout.h"
#include "frontend/dataset/rectified_rig.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// A path without its parts, which take ten times its memory: there may be hundreds of thousands.
class ShortPath {
 public:
  ShortPath() = default;
  ShortPath(const std::filesystem::path& path) : text_(path.native()) {}

  operator std::filesystem::path() const { return text_; }
  const std::string& string() const { return text_; }
  std::filesystem::path stem() const { return std::filesystem::path(text_).stem(); }
  bool empty() const { return text_.empty(); }
  bool operator==(const ShortPath& other) const { return text_ == other.text_; }

 private:
  std::string text_;
};

/// Files of one frame; empty paths where the sensor, or the folder, has none.
struct FrameFiles {
  double stamp_s = 0, clock_s = 0, depth_later_s = 0;  ///< as InputFrame's
  ShortPath image, right, depth;
};

/// "2 of 9".
inline std::string PartText(std::size_t part, std::size_t all) {
  return std::to_string(part) + " of " + std::to_string(all);
}

/// What a reader finds out about its folder.
struct FolderContents {
  std::filesystem::path folder;
  std::vector<FrameFiles> frames;  ///< stamps grow strictly
  RigCalibration rig;
  double rate_hz = 10;
  std::vector<std::filesystem::path> truth_places;  ///< the first that exists is the ground truth
  std::vector<std::pair<std::int64_t, double>>
      pose_stamps;                             ///< (line of the pose, stamp) of each frame; empty: all
  std::size_t pose_count = 0;                  ///< that a file without numbers must have
  StampUnit stamp_unit = StampUnit::kSeconds;  ///< of the images' stamps where they are written
  double stamp_scale = 1;                      ///< factor on the stamps of the ground truth
  std::size_t skipped = 0;           ///< (left, or colour) images that are no frames: Dataset::SkippedShare
  std::optional<LayoutTruth> truth;  ///< in a form of the layout's own; goes before truth_places
  DepthFormat depth;
  std::vector<std::string> warnings;

  /// Sets rate_hz to the mean rate of the frames, if there are two.
  void MeasureRate();
  /// `alone` of the frames have no depth or right image, which `list` names. All: throws InputError, "`list`:
  /// `none`"; some: warns, "`list`: 2 of 9 `some`", but not of a folder that grows, where they may still
  /// come.
  void ReportAlone(const std::filesystem::path& list, std::size_t alone, const std::string& none,
                   const std::string& some, const DatasetOptions& options);
};

/// A data set of image files. Immutable after construction.
class FolderDataset : public Dataset {
 public:
  /// Reads the first readable image for the size, and computes the rectification tables. Throws InputError.
  FolderDataset(FolderContents contents, const DatasetOptions& options);

  std::size_t Size() const override { return contents_.frames.size(); }
  double Stamp(std::size_t i) const override { return contents_.frames.at(i).stamp_s; }
  ReadResult Read(std::size_t i) const override;
  ColourImage ReadColour(std::size_t i) const override;
  /// Read frame `i`, which may have come later.
  ReadResult ReadFiles(std::size_t i, const FrameFiles& files) const;
  ColourImage ReadColourOf(const FrameFiles& files) const;
  const std::vector<FrameFiles>& Frames() const { return contents_.frames; }
  const CameraRig& Rig() const override { return rig_.rig; }
  std::optional<std::filesystem::path> GroundTruthFile() const override;
  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override;
  double SkippedShare() const override {
    const auto skipped = static_cast<double>(contents_.skipped);
    return skipped / (skipped + static_cast<double>(Size()));
  }
  const std::vector<std::string>& Warnings() const override { return contents_.warnings; }

 private:
  void FindImageSize();
  void FindRange(std::size_t place, const cv::Mat& first);
  void SetUpDepth();
  void SetUpMasks();
  std::string Rectify(const ImageFile& read, const std::filesystem::path& file,
                      const std::optional<Rectifier>& rectifier, cv::Mat& out) const;
  std::string NoFrame(std::size_t i) const;
  // Rectified; empty if this image has none. Throws InputError.
  cv::Mat MaskOf(const std::filesystem::path& image) const;

  FolderContents contents_;
  DatasetOptions options_;
  RectifiedRig rig_;
  cv::Size size_;
  GreyRange range_;
  std::optional<DepthReader> depth_;
  std::optional<ImageMasks> masks_;  // a mask for each image
  cv::Mat mask_;                     // for all images, rectified; empty: none
};

/// What videos, bags and cameras have in common: images of one rig in one recording, without ground truth
/// beside it.
class RecordedDataset : public Dataset {
 public:
  const CameraRig& Rig() const override { return rig_.rig; }
  std::optional<std::filesystem::path> GroundTruthFile() const override { return std::nullopt; }
  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override {
    return ReadTrajectory(file, GuessTrajectoryFormat(file), warnings);
  }
  const std::vector<std::string>& Warnings() const override { return warnings_; }

 protected:
  RecordedDataset(std::string name, const DatasetOptions& options)
      : name_(std::move(name)), options_(options) {}
  /// By size_ and options_.
  void SetUpRig(double rate_hz) {
    rig_ = RectifyRig(name_, options_, size_, rate_hz, warnings_);
    mask_ = MaskOfAll(options_, size_, rig_.left);
  }
  void Warn(const std::string& text) { warnings_.push_back(name_ + ": " + text); }
  std::string About(std::size_t i) const { return name_ + ": frame " + std::to_string(i); }

  const std::string name_;  // for messages
  DatasetOptions options_;
  cv::Size size_;  // of the (left) images as they are stored
  RectifiedRig rig_;
  cv::Mat mask_;  // rectified; empty: none
  std::vector<std::string> warnings_;
};

/// One line of a text file: its number and its words, comments removed.
struct TextLine {
  std::size_t number = 0;
  std::vector<std::string> words;
  std::string text;  ///< the line as it is, without the comment
};
/// All lines that carry data. Throws InputError if the file can't be opened, or is none (a folder, a pipe).
std::vector<TextLine> ReadTextLines(const std::filesystem::path& file);
/// Those of a list of files with their stamps, whose first line may name the columns.
std::vector<TextLine> ReadListLines(const std::filesystem::path& file);
/// "file:line: ".
std::string At(const std::filesystem::path& file, std::size_t line);
/// The word as a finite number. Throws InputError that names file and line.
double NumberAt(const std::filesystem::path& file, const TextLine& line, std::size_t word);

/// The first word of each line [s], or another one. `unit`: what is expected, and gets what it is; said in
/// `warnings` if it is another one. Throws InputError that names file and line.
std::vector<double> StampsAt(const std::filesystem::path& file, const std::vector<TextLine>& lines,
                             StampUnit& unit, std::vector<std::string>& warnings, std::size_t word = 0);
/// Takes ground truth apart for frames, whose poses it may number. `frames`: (number of the frame, stamp).
Trajectory StampedByFrame(const std::filesystem::path& file, const Trajectory& poses,
                          const TrajectoryDetails& details, std::size_t count,
                          const std::vector<std::pair<std::int64_t, double>>& frames);

/// Watches that the stamps of a file grow: duplicates are to be skipped (with a warning for the first five
/// and their count), unsorted stamps throw InputError. Nothing else adds warnings in the meantime.
class StampOrder {
 public:
  StampOrder(std::filesystem::path file, std::vector<std::string>& warnings)
      : file_(std::move(file)), warnings_(warnings) {}
  /// True if the line is to be used.
  bool Accept(std::size_t line, double stamp_s);
  /// Lines that were not.
  std::size_t skipped() const { return skipped_; }

 private:
  std::filesystem::path file_;
  std::vector<std::string>& warnings_;
  std::optional<double> last_;
  std::size_t skipped_ = 0;
};

/// For each of `a` the place in `b`, or -1: pairs with the smallest difference first, at most `limit_s`, each
/// stamp once (as TUM's associate.py). Both grow.
std::vector<int> AssociateStamps(const std::vector<double>& a, const std::vector<double>& b, double limit_s);

/// Position of a camera in camera 0, from P = K [I | t].
Eigen::Vector3d PositionOfCamera(const Eigen::Matrix<double, 3, 4>& p);

FolderContents FindKitti(const std::filesystem::path& folder, const DatasetOptions& options);
FolderContents FindTum(const std::filesystem::path& folder, const DatasetOptions& options);
FolderContents FindEuroc(const std::filesystem::path& folder, const DatasetOptions& options);
FolderContents FindImages(const std::filesystem::path& folder, const DatasetOptions& options);
/// A layout of layout.h.
FolderContents FindPaired(const std::filesystem::path& folder, const DatasetOptions& options);
/// The folder of an iPhone's recorder: a video, depth images, odometry.csv.
std::unique_ptr<Dataset> OpenStrayScanner(const std::filesystem::path& folder, const DatasetOptions& options);
/// A folder that grows: `find` lists it as it is now. Waits options.follow_s for the first image.
std::unique_ptr<Dataset> FollowFolder(std::function<FolderContents()> find, const DatasetOptions& options);
/// camera:0, a pair camera:0,1, the files that stand in for them, or a stream.
std::unique_ptr<Dataset> OpenCamera(const std::string& name, const DatasetOptions& options);
/// A bag of ROS 1 or 2: a file, or the folder that 'ros2 bag record' leaves.
std::unique_ptr<Dataset> OpenBag(const std::filesystem::path& file, const DatasetOptions& options);
std::unique_ptr<Dataset> OpenVideo(const std::filesystem::path& file, const DatasetOptions& options);

}  // namespace tutti
