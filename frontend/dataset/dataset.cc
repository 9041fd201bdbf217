#include "tutti/frontend/dataset.h"

#include <algorithm>

#include "frontend/dataset/bag.h"
#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/image_file.h"
#include "frontend/dataset/rectified_rig.h"
#include "frontend/dataset/wrapped_dataset.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// What a folder holds, by the names in it alone; it looks into no folder further down than a layout has its
// own.
std::optional<DatasetType> FolderType(const fs::path& path) {
  std::error_code code;
  const auto folder = [&](const char* name) { return fs::is_directory(path / name, code); };
  const auto file = [&](const char* name) { return fs::is_regular_file(path / name, code); };
  if (folder("mav0/cam0") || file("cam0/sensor.yaml")) return DatasetType::kEuroc;
  if (folder("image_0") || folder("image_2")) return DatasetType::kKitti;
  if (file("rgb.txt") || file("associations.txt") || file("color.txt")) return DatasetType::kTum;
  if (IsStrayScanner(path) || FindLayout(path)) return DatasetType::kPaired;
  if (!ListImages(path).empty()) return DatasetType::kImages;
  if (!Bag::Files(path).empty()) return DatasetType::kBag;
  return std::nullopt;
}

std::optional<DatasetType> DetectedType(const fs::path& path) {
  std::error_code code;
  if (fs::is_directory(path, code)) return FolderType(path);
  try {
    return DetectDatasetType(path);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

// The data sets in the folders of this one, for somebody who gave the folder above.
std::string DataSetsInside(const fs::path& folder) {
  std::error_code code;
  std::vector<std::string> names;
  for (fs::directory_iterator it(folder, code), end; !code && it != end; it.increment(code)) {
    if (it->is_directory(code) && DetectedType(it->path())) names.push_back(it->path().filename().string());
  }
  if (names.empty()) return {};
  std::sort(names.begin(), names.end(), NaturalLess);
  constexpr std::size_t kNamed = 5;
  const std::string more = names.size() > kNamed ? ", ..." : "";
  names.resize(std::min(kNamed, names.size()));
  return ". There are data sets in it: give one of " + JoinText(names) + more;
}

}  // namespace

EnumWords<DatasetType> WordsOf(DatasetType /*of*/) {
  return {{"auto", DatasetType::kAuto},   {"kitti", DatasetType::kKitti},   {"tum", DatasetType::kTum},
          {"euroc", DatasetType::kEuroc}, {"paired", DatasetType::kPaired}, {"images", DatasetType::kImages},
          {"video", DatasetType::kVideo}, {"bag", DatasetType::kBag}};
}

EnumWords<Sensor> WordsOf(Sensor /*of*/) {
  return {{"mono", Sensor::kMono}, {"stereo", Sensor::kStereo}, {"rgbd", Sensor::kRgbd}};
}

std::optional<Pose> RigidTransform(const TransformRows& rows) {
  if (std::all_of(rows.begin(), rows.end(), [](double v) { return v == 0; })) return std::nullopt;
  const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows.data());
  const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
  const bool rotation = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= 0.01 &&
                        R.determinant() > 0;  // false if anything is not finite
  if (!rotation || matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    throw InputError(
        "is not a rigid transform: 4 rows are needed, a rotation with the translation [m] behind it, and "
        "0, 0, 0, 1");
  return Pose::FromMatrix(matrix.topRows<3>());
}

std::string DatasetOptions::Validate() const {
  std::string problem = OutOfRange(*this);
  if (!problem.empty()) return problem;
  const std::string key = "camera.right.T_right_left ";
  std::optional<Pose> T;
  try {
    T = RigidTransform(T_right_left);
  } catch (const InputError& e) {
    return key + e.what();
  }
  if (right.has_value() != T.has_value())
    return right ? key + "is missing: where is the right camera?"
                 : key + "needs the right camera's fx, fy, cx and cy beside it";
  if (!right) return "";
  problem = right->Validate();
  // It speaks of "camera.fx" or of the "camera: ...".
  return problem.empty() ? "" : "camera.right" + problem.substr(std::string("camera").size());
}

DatasetOptions ForAnotherRecording(DatasetOptions options) {
  std::error_code ignored;
  options.start = options.end = 0;
  options.stride = 1;
  if (fs::is_directory(options.mask, ignored)) options.mask.clear();
  return options;
}

bool Dataset::WaitFor(std::size_t i, const std::function<bool()>&) const { return i < Size(); }

ColourImage Dataset::ReadColour(std::size_t i) const {
  const ReadResult read = Read(i);
  if (!read.frame) return {cv::Mat(), read.error};
  return {ToColour(read.frame->image), {}};
}

std::optional<std::size_t> FindStamp(const Dataset& dataset, double stamp_s) {
  constexpr double kSame = 1e-6;
  std::size_t low = 0, high = dataset.Size();  // the first that is not earlier
  while (low < high) {
    const std::size_t middle = low + (high - low) / 2;
    if (dataset.Stamp(middle) < stamp_s - kSame)
      low = middle + 1;
    else
      high = middle;
  }
  if (low == dataset.Size() || dataset.Stamp(low) > stamp_s + kSame) return std::nullopt;
  return low;
}

FolderContents FindImages(const fs::path& folder, const DatasetOptions& options) {
  if (options.sensor != Sensor::kMono)
    throw InputError(folder.string() +
                     ": a plain folder of images is mono; for stereo use the KITTI or EuRoC layout, for "
                     "RGB-D the TUM layout (data/README.md shows them)");
  FolderContents out;
  out.folder = folder;
  out.rig.left = options.camera;
  out.rate_hz = options.rate_hz > 0 ? options.rate_hz : 10.0;
  const std::vector<fs::path> files = FramesIn(folder, false, &out.warnings);
  if (files.empty()) throw InputError(folder.string() + ": holds no images (png, jpg, webp, ...)");
  const internal::StampsOfNames named = StampsInNames(files);
  // In a folder that grows, the first names must show the unit.
  constexpr double kSince1970_s = 5e8;
  const bool has_stamps = named.stamps.size() == files.size() &&
                          (options.follow_s == 0 || named.stamps.front().first >= kSince1970_s);
  for (std::size_t i = 0; i < files.size(); ++i) {
    FrameFiles frame;
    frame.stamp_s = has_stamps ? named.stamps[i].first : static_cast<double>(i) / out.rate_hz;
    frame.image = files[has_stamps ? named.stamps[i].second : i];
    out.frames.push_back(std::move(frame));
  }
  if (has_stamps) {
    out.stamp_unit = named.unit;
    out.MeasureRate();
    out.warnings.push_back(folder.string() +
                           ": the images have the time stamps that they are called by, in " +
                           internal::NameOf(named.unit));
  }
  if (!out.rig.left) out.warnings.push_back(NoCalibrationText(folder.string()));
  out.truth_places = {folder / "groundtruth.txt", folder / "poses.txt"};
  return out;
}

DatasetType DetectDatasetType(const fs::path& path) {
  if (IsCamera(path.string()))
    throw InputError(path.string() +
                     ": gives its frames once, in order, and all of them are needed here; save them as a "
                     "video file, and give that");
  std::error_code code;
  if (!fs::exists(path, code))
    throw InputError(path.string() +
                     ": does not exist; give the folder of a data set, a folder of images, or a video file");
  if (!fs::is_directory(path, code)) {
    if (HasImageExtension(path))
      throw InputError(path.string() + ": is a single image; give the folder that holds it");
    return Bag::IsNamed(path) ? DatasetType::kBag : DatasetType::kVideo;
  }
  if (const std::optional<DatasetType> type = FolderType(path)) return *type;
  const fs::directory_iterator entries(path, code);
  if (code)
    throw InputError(path.string() + ": can't be listed (" + code.message() + "); check its permissions");
  throw InputError(
      path.string() + (entries == fs::directory_iterator() ? ": is empty" : ": holds no data set") +
      "; expected image_0/ (KITTI), rgb.txt (TUM), mav0/cam0/ (EuRoC), another layout of data/README.md, "
      "images, or bags of ROS 2" +
      DataSetsInside(path));
}

namespace {

// What is opened for a path and a type.
struct Place {
  fs::path path;
  DatasetType type = DatasetType::kAuto;
  std::string note;  // empty: what was given
};

// A configuration says the layout, and the path is the folder of images inside it: the data set that it is
// part of; else its images alone, if that is enough. Nothing if neither is so.
std::optional<Place> Around(const fs::path& path, const DatasetOptions& options) {
  std::error_code code;
  const fs::path given = (fs::absolute(path, code).lexically_normal() / "").parent_path();
  fs::path folder = given;
  for (int level = 0; level < 3 && folder.has_relative_path(); ++level) {
    folder = folder.parent_path();
    if (DetectedType(folder) != options.type) continue;
    const std::optional<fs::path> images = ImagesOfDataset(folder);
    // mav0/cam0 for mav0/cam0/data
    if (images &&
        (fs::equivalent(*images, given, code) || fs::equivalent(images->parent_path(), given, code)))
      return Place{folder, options.type,
                   path.string() + ": is part of " + folder.string() + ", which is read"};
    throw InputError(path.string() + ": is part of " + folder.string() +
                     ", but does not hold its left (or colour) images; give that folder");
  }
  if (DetectedType(path) != DatasetType::kImages || options.sensor != Sensor::kMono || !options.camera)
    return std::nullopt;
  return Place{
      path, DatasetType::kImages,
      path.string() + ": is not in the layout of the configuration; its images are read as a plain folder"};
}

Place PlaceToOpen(const fs::path& path, const DatasetOptions& options) {
  std::error_code code;
  const bool folder = fs::is_directory(path, code);
  const bool layout = options.type == DatasetType::kKitti || options.type == DatasetType::kTum ||
                      options.type == DatasetType::kEuroc || options.type == DatasetType::kPaired;
  if (layout && folder && DetectedType(path).value_or(DatasetType::kImages) == DatasetType::kImages) {
    if (std::optional<Place> around = Around(path, options)) return *around;
  }
  const DatasetType seen = DetectDatasetType(path);  // missing or empty: the same words for every type
  const DatasetType type = options.type == DatasetType::kAuto ? seen : options.type;
  const auto is_file = [](DatasetType t) { return t == DatasetType::kVideo || t == DatasetType::kBag; };
  if (is_file(type) != is_file(seen) || (folder && type == DatasetType::kVideo))
    throw InputError(path.string() + (is_file(type)
                                          ? ": is a folder, but the type is video or bag; give the file"
                                      : folder ? ": holds bags of ROS 2; let dataset.type be auto, or bag"
                                               : ": is a file; give the folder of the data set"));
  return {path, type, {}};
}

FolderContents FindFrames(const fs::path& path, const DatasetOptions& options) {
  const Place place = PlaceToOpen(path, options);
  const auto find = place.type == DatasetType::kKitti    ? FindKitti
                    : place.type == DatasetType::kTum    ? FindTum
                    : place.type == DatasetType::kEuroc  ? FindEuroc
                    : place.type == DatasetType::kPaired ? FindPaired
                                                         : FindImages;
  FolderContents contents = find(place.path, options);
  if (!place.note.empty()) contents.warnings.push_back(place.note);
  return contents;
}

std::unique_ptr<Dataset> OpenWhole(const fs::path& path, const DatasetOptions& use) {
  if (IsCamera(path.string())) return OpenCamera(path.string(), use);
  std::error_code code;
  if (use.follow_s > 0) {
    if (!fs::is_directory(path, code))
      throw InputError(path.string() + ": is no folder; only a folder of images can be followed");
    return FollowFolder([path, use] { return FindFrames(path, use); }, use);
  }
  const DatasetType type = PlaceToOpen(path, use).type;
  if (type == DatasetType::kVideo) return OpenVideo(path, use);
  if (type == DatasetType::kBag) return OpenBag(path, use);
  if (type == DatasetType::kPaired && IsStrayScanner(path)) return OpenStrayScanner(path, use);
  return std::make_unique<FolderDataset>(FindFrames(path, use), use);
}

}  // namespace

DatasetType TypeToOpen(const fs::path& path, const DatasetOptions& options) {
  return PlaceToOpen(path, options).type;
}

std::unique_ptr<Dataset> OpenDataset(const fs::path& path, const DatasetOptions& options) {
  const std::string problem = options.Validate();
  if (!problem.empty()) throw InputError("dataset: " + problem);
  if (options.rotate % 90 != 0)
    throw InputError("dataset: rotate must be 0, 90, 180 or 270 deg, not " + std::to_string(options.rotate));
  DatasetOptions use = options;
  if (use.camera && use.camera->fy < 0) {  // ICL-NUIM's own calibration: y up
    use.camera->fy = -use.camera->fy;
    use.mirrored_ground_truth = true;
  }
  std::unique_ptr<Dataset> whole = OpenWhole(path, use);
  if (use.rotate != 0) whole = TurnFrames(std::move(whole), use.rotate, path.string());
  return AddImu(SelectFrames(std::move(whole), use, path.string()), path, use);
}

}  // namespace tutti
