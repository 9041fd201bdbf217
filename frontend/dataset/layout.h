// Layouts of public data sets and of programs that record, which keep left and right, or colour and depth,
// images in folders side by side or in one folder: one table says what is where.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "frontend/dataset/depth_reader.h"
#include "frontend/dataset/rectified_rig.h"

#pragma GCC visibility push(default)  // of the commands, too
namespace tutti {

/// Where the images of one kind are, and what tells them from others there.
struct ImageRole {
  const char* folder = nullptr;  ///< in the data set's folder; "": that folder itself; null: there are none
  const char* word = "";         ///< of the names ("color": frame-000000.color.png); "a*b": begin and end;
                                 ///< "!depth": names without that word; "": any
};

/// How the ground truth of a layout is written; poses are those of the (left, or colour) camera unless said.
enum class TruthForm {
  kNone,
  kLines,    ///< a line for each image: 3x4 or 4x4 matrix by rows, or tx ty tz qx qy qz qw
  kLog,      ///< Open3D: three numbers, then a 4x4 matrix, for each image
  kFiles,    ///< a file with a 4x4 matrix for each image, with its number; not finite where tracking was lost
  kOxts,     ///< KITTI raw: a file with latitude, longitude, ... for each image; the IMU's poses
  kOdometry  ///< Stray Scanner: stamp, frame, x, y, z, qx, qy, qz, qw
};

/// Where a layout has its ground truth.
struct TruthPlace {
  TruthForm form = TruthForm::kNone;
  const char* name = "";  ///< file or folder; "": the data set's folder itself
  const char* word = "";  ///< kFiles: of the names, as ImageRole::word
};

struct Layout {
  const char* name;  ///< empty: nobody's in particular
  ImageRole left, right, depth;
  const char* sign = "";  ///< file or folder that is there, too (one of several: a|b)
  bool pairs = false;     ///< it is this layout only where there are right or depth images
  const char* stamps = "";
  const char* intrinsics = "";        ///< 4 numbers fx fy cx cy, or a matrix of 3x3, 3x4 or 4x4
  const char* depth_intrinsics = "";  ///< of depth images that the same camera centre sees
  const char* calibration = "";       ///< of another program's format, for ReadCalibration (a|b)
  PinholeCamera published{};          ///< of all recordings with images of this size
  double baseline_m = 0;
  double depth_units_per_m = 0;  ///< 0: not known
  double rate_hz = 0;            ///< 0: not known
  TruthPlace truth{};
  bool float_in_png = false;        ///< depth: the four bytes of a pixel are a float
  bool forward_right_down = false;  ///< the ground truth's camera looks along x, y to the right
};

/// A layout that a folder has, and which images are there.
struct FoundLayout {
  const Layout* layout = nullptr;
  bool right = false, depth = false;
  /// "TartanAir (image_left, image_right)".
  std::string Text() const;
};

/// What OpenDataset reads a path as.
DatasetType TypeToOpen(const std::filesystem::path& path, const DatasetOptions& options);

/// The layout of a folder, if it is one of the table's.
std::optional<FoundLayout> FindLayout(const std::filesystem::path& folder);
/// True if its images have time stamps, in a list or their names.
bool HasStamps(const std::filesystem::path& folder);
/// Stray Scanner's: its colour images are a video.
bool IsStrayScanner(const std::filesystem::path& folder);

/// One image of a role. Those of other roles with the same key belong to it.
struct RoleImage {
  std::string key;                ///< the numbers of its name
  std::optional<double> stamp_s;  ///< where the name is one
  std::filesystem::path file;
};
/// In the order of their stamps, if all have one, else in natural order of their names. `extension`: ".txt",
/// of files that belong to images; empty: images.
std::vector<RoleImage> ImagesOf(const std::filesystem::path& folder, const ImageRole& role,
                                const std::string& extension = "");

/// The images of a folder that are frames, in natural order: without depth images, with right ones only where
/// `pairs` are wanted, and without types that a tenth of the images at most have (a picture of the ground
/// truth or of a map), of which `notes` tells.
std::vector<std::filesystem::path> FramesIn(const std::filesystem::path& folder, bool pairs,
                                            std::vector<std::string>* notes);

/// What the files of a layout, or its publication, say of the cameras.
struct LayoutCalibration {
  RigCalibration rig;
  std::optional<PinholeCamera> depth;  ///< of depth images that are not of the colour images' size
  std::string source;                  ///< "calib_cam_to_cam.txt"; empty: they say nothing
  double depth_units_per_m = 0;        ///< 0: not known
  std::vector<std::string> notes;
};
/// `size`: of the images. Throws InputError.
LayoutCalibration ReadLayoutCalibration(const std::filesystem::path& folder, const FoundLayout& found,
                                        cv::Size size);
LayoutCalibration ReadKittiRawCalibration(const std::filesystem::path& folder, const FoundLayout& found,
                                          cv::Size size);

/// Lists of TUM's layout.
struct TumLists {
  const char* colour = "rgb.txt";
  const char* depth = "depth.txt";  ///< OpenLORIS: registered depth has a list of its own
};
TumLists TumListsOf(const std::filesystem::path& folder);
/// Reads the calibration that data sets in TUM's layout may have: OpenLORIS (sensors.yaml), ETH3D
/// (calibration.txt).
LayoutCalibration ReadTumCalibration(const std::filesystem::path& folder);

/// One camera of an ASL data set.
struct SensorYaml {
  PinholeCamera camera;
  std::optional<Pose> T_body_sensor;  ///< T_BS, where the file has it
  std::optional<double> rate_hz;
};
/// EuRoC's sensor.yaml. Throws InputError that names file and line for a missing file or key, a wrong number
/// of values, an unknown model.
SensorYaml ReadSensorYaml(const std::filesystem::path& file);

/// What a layout says of its depth images, but for their camera.
DepthFormat FormatOfDepth(const Layout& layout);
/// The intrinsics of a file of 4 numbers, or a matrix. Throws InputError.
PinholeCamera ReadIntrinsics(const std::filesystem::path& file);

/// Time stamps [s], a line each: a number, or KITTI's date and time (2011-09-26 13:02:25.964389445, UTC).
std::vector<std::pair<std::size_t, double>> ReadLayoutStamps(const std::filesystem::path& file);

/// Ground truth in the form of a layout, and what it needs to be read.
struct LayoutTruth {
  std::filesystem::path place;  ///< file or folder
  TruthForm form = TruthForm::kNone;
  ImageRole role;                                      ///< kFiles
  std::vector<std::pair<std::string, double>> stamps;  ///< key and stamp [s] of each image; NaN: refused
};
/// True if something is there.
bool HoldsTruth(const LayoutTruth& truth);
/// T_world_body. Throws InputError with file and line.
Trajectory ReadLayoutTruth(const LayoutTruth& truth, std::vector<std::string>* warnings);

}  // namespace tutti
#pragma GCC visibility pop
