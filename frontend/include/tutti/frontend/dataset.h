// Where frames come from: KITTI, TUM, EuRoC, other layouts, a folder of images, a video.
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tutti/core/options.h"
#include "tutti/core/pose.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/imu.h"

#pragma GCC visibility push(default)
namespace tutti {

/// A frame, or why there is none.
struct ReadResult {
  std::optional<InputFrame> frame;
  std::string error;        ///< names the file and what is wrong with it; empty if there is a frame
  std::string depth_error;  ///< the same of a depth or right image that the frame comes without
};

/// A colour image, or why there is none.
struct ColourImage {
  cv::Mat image;      ///< CV_8UC3, blue first; empty if it can't be read
  std::string error;  ///< names the file and what is wrong with it; empty if there is an image
};

/// The layout of a data set on disk.
enum class DatasetType { kAuto, kKitti, kTum, kEuroc, kPaired, kImages, kVideo, kBag };

/// The words of the YAML files.
EnumWords<DatasetType> WordsOf(DatasetType);

/// A rigid transform as calibrations give it: 4x4 matrix, row by row, translation in metres. Zeros are none.
using TransformRows = std::array<double, 16>;

/// How to read a data set: sections `dataset:` and `camera:` of the YAML files.
struct DatasetOptions {
  TUTTI_OPTION(DatasetType, type, DatasetType::kAuto,
               "layout on disk; auto: from what the folder holds. paired: left and right, or colour and "
               "depth, images side by side, as in TartanAir, ScanNet and others (data/README.md)",
               Basic());
  TUTTI_OPTION(Sensor, sensor, Sensor::kMono, "what the camera is", Basic());
  TUTTI_OPTION(double, depth_units_per_m, 0,
               "RGB-D: value in the depth image of one metre (1000: millimetres); 0: that of the layout, "
               "1000 in a ROS bag, else 5000 (TUM), and floats are metres",
               Basic(), From(0));
  TUTTI_OPTION(double, max_depth_m, 0, "RGB-D: farther depth is not used; 0: no limit", Basic(), Unit("m"),
               From(0));
  TUTTI_OPTION(double, max_association_s, 0.02,
               "TUM, ROS bag: greatest difference of the stamps of colour and depth; a colour image without "
               "depth is tracked with colour alone",
               Unit("s"), From(0));
  TUTTI_OPTION(double, rate_hz, 0,
               "frame rate where the data has no time stamps, and in place of those of a video; 0: 10 Hz, or "
               "the video's own stamps",
               Basic(), Unit("1/s"), From(0));
  TUTTI_OPTION(std::string, topic, "",
               "ROS bag: images of the left (or only, or colour) camera; empty: the bag's only one", Basic());
  TUTTI_OPTION(std::string, right_topic, "",
               "ROS bag, stereo: images of the right camera, rectified, or raw with camera.right", Basic());
  TUTTI_OPTION(std::string, depth_topic, "",
               "ROS bag, RGB-D: depth images, 16UC1 (depth_units_per_m; ROS itself: 1000) or 32FC1 (metres)",
               Basic());
  TUTTI_OPTION(double, follow_s, 0,
               "a folder that is still being written to: wait for new images, end when none came for so "
               "long; 0: all images are there",
               Unit("s"), From(0));
  TUTTI_OPTION(int, start, 0, "first frame that is used, counted from 0", Basic(), From(0));
  TUTTI_OPTION(int, end, 0, "frame before which to stop (the first that is not used); 0: use all", Basic(),
               From(0));
  TUTTI_OPTION(int, stride, 1, "use every stride-th frame, from the first that is used on", Basic(), From(1));
  TUTTI_OPTION(std::string, mask, "",
               "8-bit image as large as those of the (left) camera, as they are stored: where it is 0 (the "
               "robot's own body), the images are not used; or a folder with such a mask for each image, "
               "which has the image's name (for what moves). Empty: all is used",
               Basic());
  TUTTI_OPTION(int, rotate, 0,
               "turn the images so far clockwise, so that they are upright: 90, 180 or 270. The camera is "
               "given as it is, before that",
               Basic(), Unit("deg"), From(0), To(270));
  TUTTI_OPTION(
      bool, imu, true,
      "use the measurements of an IMU that lie beside the images (mav0/imu0, imu.csv, imu.txt), unless "
      "they contradict themselves or the images (--no-imu turns it off)");
  TUTTI_OPTION(
      std::string, imu_topic, "",
      "ROS bag: measurements of the IMU (sensor_msgs/Imu); empty: the bag's only ones, or RealSense's "
      "two (gyro, accel)");
  TUTTI_OPTION(double, noise, 0,
               "standard deviation of Gaussian noise that is added to the images, to see how a result holds; "
               "0: none",
               Unit("grey levels of 255"), From(0));
  TUTTI_OPTION(int, noise_draw, 0, "another number, another noise; the same number, the same noise", From(0));
  TUTTI_OPTION(bool, mirrored_ground_truth, false,
               "the ground truth has its y axis up (left-handed, as ICL-NUIM with its negative fy): it is "
               "mirrored when read");
  TUTTI_OPTION(std::optional<PinholeCamera>, camera, std::nullopt,
               "as calibrated, with its distortion; absent: from sensor.yaml (EuRoC), calib.txt (KITTI)",
               Basic(), Section("camera"));
  TUTTI_OPTION(
      std::optional<PinholeCamera>, right, std::nullopt,
      "stereo, raw pairs: the right camera as calibrated, with its distortion; absent: the pairs are "
      "rectified, or sensor.yaml (EuRoC) says it",
      Section("camera.right"));
  TUTTI_OPTION(
      TransformRows, T_right_left, {},
      "stereo, raw pairs: 4x4 matrix, row by row, that takes a point from the left camera's frame to "
      "the right one's (Kalibr: T_cn_cnm1 of cam1; OpenCV: R and T), translation in metres",
      Section("camera.right"));
  TUTTI_OPTION(
      double, baseline_m, 0,
      "stereo, rectified pairs: distance of the cameras, where sensor.yaml or calib.txt does not say "
      "it",
      Basic(), Section("camera"), Unit("m"), From(0));
  TUTTI_OPTION(
      double, fov_deg, 0,
      "horizontal field of view, in place of fx, fy, cx and cy, where nothing else says them: square "
      "pixels, principal point in the middle; 0: not known",
      Section("camera"), Unit("deg"), From(0), To(170));
  TUTTI_OPTION(double, readout_s, 0,
               "rolling shutter: the last row is read so long after the first; 0: all rows at once", Basic(),
               Section("camera"), Unit("s"), From(0), To(0.1));
  TUTTI_OPTION(double, depth_delay_s, 0,
               "RGB-D: a depth image was taken so long before its time stamp, by the colour camera's clock; "
               "negative: after it; 0: unknown, colour and depth are taken to be of one time",
               Section("camera"), Unit("s"), From(-0.1), To(0.1));
  TUTTI_OPTION(
      TransformRows, T_camera_imu, {},
      "4x4 matrix, row by row, that takes a point from the IMU's frame to that of the (left) camera as "
      "calibrated (Kalibr: T_cam_imu of cam0), translation in metres; zeros: as the data set has it, "
      "else it is measured",
      Section("camera"));
  TUTTI_OPTION(
      double, time_offset_s, 0,
      "added to the IMU's stamps gives the camera's clock (Kalibr: timeshift_cam_imu, with the other "
      "sign); what is left of it, up to 0.075 s, is measured",
      Section("imu"), Unit("s"), From(-10), To(10));
  TUTTI_OPTIONS_END;

  /// Empty if usable, else what is wrong.
  std::string Validate() const;
};

/// The transform, or nothing where it is zeros. Throws InputError if it is not rigid.
std::optional<Pose> RigidTransform(const TransformRows& rows);

/// The options of a recording, for another one of the same camera: all frames, and no masks of single images.
DatasetOptions ForAnotherRecording(DatasetOptions options);

/// How frames come to be there.
enum class Supply {
  kStored,   ///< all are there
  kGrowing,  ///< more may come; those that are there can be read at any time
  kOnce,     ///< more may come, and each can be read once, in order (a camera)
};

/// A sequence of frames with random access. Read() is safe to call from several threads at once. Each (left,
/// or colour) image is a frame, also where it can't be read, and where its depth or right image is absent.
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
  /// InputFrame::index of frame i: its place, counted from 0, among all images of the data set. That is i
  /// itself unless DatasetOptions::start or stride leave some out. An image whose line is refused (it repeats
  /// a time stamp) does not count.
  virtual std::int64_t Number(std::size_t i) const { return static_cast<std::int64_t>(i); }
  /// Reads and rectifies frame i. Unreadable, truncated, or of another size than the first: error, no
  /// exception. If that is so of the depth or right image alone, the frame comes without it.
  virtual ReadResult Read(std::size_t i) const = 0;
  /// The (left, or only) image of frame i as it is stored, in colour, rectified as Read() does it: the same
  /// size and pixels, without DatasetOptions::noise. Three times grey where the data is grey. Errors as
  /// Read().
  virtual ColourImage ReadColour(std::size_t i) const;
  /// Share of the (left, or only) images of the whole data set that are no frames: they repeat a time stamp,
  /// or lie in a damaged part of a bag. Warnings() says which.
  virtual double SkippedShare() const { return 0; }
  /// The rig after rectification.
  virtual const CameraRig& Rig() const = 0;
  /// What the measurements of an IMU beside the images show by themselves. With findings, frames come without
  /// them. Nothing: there is no IMU, or it is not wanted.
  virtual std::optional<ImuReport> Imu() const { return std::nullopt; }
  /// Clockwise angle by which the images of a video were turned, as its rotation flag says [deg]: the rig's
  /// camera was turned with them from that of the options, which is of the sensor's own orientation.
  virtual int TurnedBy() const { return 0; }
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

/// The place of the frame with this stamp [s], for Read(); nothing if there is none within 1e-6 s.
std::optional<std::size_t> FindStamp(const Dataset& dataset, double stamp_s);

/// What a folder (or file) looks like. Throws InputError for a missing path, an empty folder, or one that
/// holds no data set.
DatasetType DetectDatasetType(const std::filesystem::path& path);

/// True for what gives its frames once, in order, and is no file to look at before: "camera:0", a pair
/// "camera:0,1", files in their stead ("camera:FILE"), addresses of streams (IsStream), "-" (standard input),
/// and pipes that have a name.
bool IsCamera(const std::string& name);
/// True for those that keep their own time: "camera:0", "camera:0,1" and streams.
bool IsCameraDevice(const std::string& name);
/// What is behind "camera:", split at commas: {"0", "1"} of "camera:0,1", {FILE} of "camera:FILE", also where
/// the name of an existing file has a comma. Of a stream its address, of a pipe its name; of another name
/// nothing.
std::vector<std::string> CameraSources(const std::string& name);
/// True for a pipe that has a name, and for "-" unless a file is redirected to it: it can be opened once.
bool IsPipe(const std::string& name);
/// True for addresses: "rtsp://...", "rtsps://...", "http://...", "https://...".
bool IsStream(const std::string& name);

/// Opens a data set: a folder, a video file, a camera (camera:0), two (camera:LEFT,RIGHT for stereo,
/// camera:COLOUR,DEPTH for RGB-D), files that stand in for them, a stream (rtsp://..., http://...), or a
/// video through a pipe (- is standard input). One camera or stream with sensor stereo gives both images side
/// by side, left and right. Throws InputError if there is nothing usable: missing or empty folder, no
/// calibration where one is needed, unsorted time stamps, ... The message says what was expected where.
std::unique_ptr<Dataset> OpenDataset(const std::filesystem::path& path, const DatasetOptions& options);

}  // namespace tutti
#pragma GCC visibility pop
