// Where frames come from: KITTI, TUM, EuRoC, a folder of images, a video.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tutti/core/trajectory.h"
#include "tutti/frontend/frame.h"

namespace tutti {

/// A frame, or why there is none.
struct ReadResult {
  std::optional<InputFrame> frame;
  std::string error;  ///< names the file and what is wrong with it; empty if there is a frame
};

/// The layout of a data set on disk.
enum class DatasetType { kAuto, kKitti, kTum, kEuroc, kImages, kVideo, kBag };

/// How to read a data set. Every field has a key of the same name under `dataset:` and `camera:` in the YAML
/// files.
struct DatasetOptions {
  DatasetType type = DatasetType::kAuto;  ///< kAuto: from what the folder holds
  Sensor sensor = Sensor::kMono;
  std::optional<PinholeCamera> camera;  ///< as calibrated (with its distortion); EuRoC: from sensor.yaml
                                        ///< where absent, KITTI: from calib.txt where absent
  double baseline_m = 0;                ///< stereo without sensor.yaml or calib.txt [m]
  double depth_units_per_m = 5000;      ///< RGB-D: value in the depth image of one metre
  double max_depth_m = 0;               ///< RGB-D: farther depth is not used [m]; 0 = no limit
  double max_association_s = 0.02;      ///< TUM: greatest difference of the stamps of colour and depth [s]
  double rate_hz = 0;  ///< frames per second where the data has no time stamps; 0: 10 Hz or the video's
  std::string topic;   ///< ROS bag: images of the left (or only, or colour) camera; empty: the bag's only one
  std::string right_topic;  ///< ROS bag, stereo: of the right camera, rectified like the left
  std::string depth_topic;  ///< ROS bag, RGB-D: 16UC1 (depth_units_per_m; ROS itself: 1000) or 32FC1 (metres)
  double follow_s = 0;  ///< a folder that is still being written to: wait for new images, end when none came
                        ///< for so long [s]; 0: all images are there
  int stride = 1;       ///< use every stride-th frame
  bool mirrored_ground_truth = false;  ///< ground truth has its y axis up (left-handed, as ICL-NUIM with its
                                       ///< negative fy): it is mirrored when read

  /// Empty if usable, else what is wrong.
  std::string Validate() const;
};

/// How frames come to be there.
enum class Supply {
  kStored,   ///< all are there
  kGrowing,  ///< more may come; those that are there can be read at any time
  kOnce,     ///< more may come, and each can be read once, in order (a camera)
};

/// A sequence of frames with random access. Read() is safe to call from several threads at once.
class Dataset {
 public:
  virtual ~Dataset() = default;
  virtual Supply FrameSupply() const { return Supply::kStored; }
  /// Returns true when frame i is there, at once if it is already; false if it will never be: the end, or
  /// `stop` became true.
  virtual bool WaitFor(std::size_t i, const std::function<bool()>& stop) const;
  /// Number of frames that the data set lists; of a growing one, so far.
  virtual std::size_t Size() const = 0;
  /// Time stamp of frame i [s]; strictly growing.
  virtual double Stamp(std::size_t i) const = 0;
  /// Reads and rectifies frame i. Unreadable, truncated, or of another size than the first: error, no
  /// exception.
  virtual ReadResult Read(std::size_t i) const = 0;
  /// The rig after rectification.
  virtual const CameraRig& Rig() const = 0;
  /// Ground truth in its usual place in the folder (T_world_body, stamps as Stamp()), if there is any.
  virtual std::optional<std::filesystem::path> GroundTruthFile() const = 0;
  /// Reads a ground-truth file for this data set: format guessed, KITTI poses get the data set's stamps, and
  /// must be as many. Throws InputError with file and line. A time stamp that stands there twice keeps its
  /// first pose and says so in `warnings`; without `warnings` (null) it is an error.
  virtual Trajectory ReadGroundTruth(const std::filesystem::path& file,
                                     std::vector<std::string>* warnings) const = 0;
  /// Notes for the log about what was found and decided: skipped duplicates, frames without depth, ...
  virtual const std::vector<std::string>& Warnings() const = 0;
};

/// What a folder (or file) looks like. Throws InputError for a missing path, an empty folder, or one that
/// holds no data set.
DatasetType DetectDatasetType(const std::filesystem::path& path);

/// True for "camera:0" and "camera:FILE".
bool IsCamera(const std::string& name);
/// True for "camera:0" alone.
bool IsCameraDevice(const std::string& name);

/// Opens a data set: a folder, a video file, a camera (camera:0), or a video file that stands in for one
/// (camera:FILE). Throws InputError if there is nothing usable: missing or empty
/// folder, no calibration where one is needed, unsorted time stamps, ... The message says what was expected
/// where.
std::unique_ptr<Dataset> OpenDataset(const std::filesystem::path& path, const DatasetOptions& options);

}  // namespace tutti
