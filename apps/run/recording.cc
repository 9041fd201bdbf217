#include "apps/run/recording.h"

#include <algorithm>
#include <cstdio>

#include "apps/run/calibration_file.h"
#include "core/camera_text.h"
#include "core/example_configs.h"
#include "core/text_reader.h"
#include "frontend/dataset/image_file.h"
#include "frontend/dataset/layout.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// Horizontal field of view where nothing says it: between phones and webcams (60 to 70 deg) and those of
// robots and cars (70 to 90).
constexpr double kUsualView = 67;

constexpr const char* kConfiguration = "config.yaml";

bool HasImages(const fs::path& folder) {
  std::error_code ignored;
  return fs::is_directory(folder, ignored) && !fs::is_empty(folder, ignored);
}

std::string Short(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

// A configuration of those that come along, for all but its camera.
RunConfig Published(const std::string& name) {
  return ParseConfig(internal::ExampleConfig(name).value(), "tutti's " + name + ".yaml");
}

// What can be opened once is opened for the run alone: its size is not known before.
bool OpensOnce(const fs::path& dataset) {
  const std::vector<std::string> sources = CameraSources(dataset.string());
  return std::any_of(sources.begin(), sources.end(), IsPipe);
}

// The camera of the images by their size alone, with this field of view [deg] if one is given.
PinholeCamera CameraBySize(const fs::path& dataset, const DatasetOptions& options, double view_deg = 0) {
  const bool live = IsCamera(dataset.string());
  DatasetOptions any = options;
  if (!live) any.sensor = Sensor::kMono;  // of cameras it says how large one of two images is
  any.start = any.end = 0;
  any.camera.reset();
  any.right.reset();
  any.T_right_left = {};
  any.mask.clear();
  any.rotate = 0;
  any.fov_deg = view_deg;
  any.baseline_m = 1;  // of pairs; it decides nothing here
  const DatasetType type = live ? DatasetType::kVideo : DetectDatasetType(dataset);
  if (type == DatasetType::kKitti || type == DatasetType::kTum) {
    // Without any camera these can't be opened: one that fits every image.
    any.type = DatasetType::kImages;
    if (const std::optional<fs::path> images = ImagesOfDataset(dataset))
      return OpenDataset(*images, any)->Rig().camera;
    throw InputError(dataset.string() +
                     ": the size of the images is not known; use --calibration with a file that has it");
  }
  if (IsCameraDevice(dataset.string()) && !IsStream(dataset.string()))
    throw InputError(dataset.string() + ": a live camera needs a calibration with its image size");
  return OpenDataset(dataset, any)->Rig().camera;
}

// The pixels that the camera must fit.
void SetImageSize(const fs::path& dataset, const DatasetOptions& options, PinholeCamera& camera) {
  if ((camera.width > 0 && camera.height > 0) || OpensOnce(dataset)) return;
  const PinholeCamera seen = CameraBySize(dataset, options);
  camera.width = seen.width;
  camera.height = seen.height;
}

void CheckCamera(const PinholeCamera& camera, const std::string& source) {
  const std::string problem = camera.Validate();
  if (!problem.empty()) throw InputError(source + ": " + problem);
}

// Where the camera comes from, for the findings.
std::string SetRequested(const fs::path& dataset, const CameraRequest& request, DatasetOptions& options) {
  const int given =
      int(request.calibration.has_value()) + int(!request.camera.empty()) + int(request.view_deg.has_value());
  if (given > 1) throw InputError("--calibration, --camera and --fov say the same; give one of them");
  PinholeCamera camera;
  std::string source;
  if (request.calibration) {
    const Calibration calibration = ReadCalibration(*request.calibration, options.sensor == Sensor::kStereo);
    camera = calibration.camera;
    if (calibration.baseline_m > 0 || calibration.right) {  // where the right camera is
      options.baseline_m = calibration.baseline_m;
      options.right = calibration.right;
      options.T_right_left = calibration.T_right_left;
    }
    if (calibration.T_camera_imu != TransformRows{}) options.T_camera_imu = calibration.T_camera_imu;
    if (calibration.imu_offset_s != 0) options.time_offset_s = calibration.imu_offset_s;
    if (calibration.depth_units_per_m > 0) options.depth_units_per_m = calibration.depth_units_per_m;
    source = request.calibration->filename().string() + ", " + calibration.format;
    SetImageSize(dataset, options, camera);
    if (options.right) SetImageSize(dataset, options, *options.right);
  } else if (!request.camera.empty()) {
    camera = internal::ParseCamera(request.camera);
    source = "--camera";
    SetImageSize(dataset, options, camera);
  } else {
    source = "--fov " + Short(*request.view_deg);
    if (OpensOnce(dataset)) {
      options.fov_deg = *request.view_deg;
      options.camera.reset();
      return source;
    }
    camera = CameraBySize(dataset, options, *request.view_deg);
  }
  if (camera.width > 0) CheckCamera(camera, source);  // else once there is an image
  if (options.right) CheckCamera(*options.right, source + ": right");
  options.camera = camera;
  return source;
}

/// Puts a Recording together.
class Recogniser {
 public:
  Recogniser(const fs::path& dataset, const CameraRequest& request)
      : dataset_(dataset), request_(request), sensor_(request.sensor) {}

  Recording Make() {
    const bool live = IsCamera(dataset_.string());
    const DatasetType type = live ? DatasetType::kVideo : DetectDatasetType(dataset_);
    if (!live && HasConfiguration()) {
      Configured();
    } else if (type == DatasetType::kKitti) {
      Kitti();
    } else if (type == DatasetType::kTum) {
      Tum();
    } else if (type == DatasetType::kEuroc) {
      Euroc();
    } else if (type == DatasetType::kPaired) {
      Paired();
    } else {
      Single(type, live);
    }
    Say();
    return out_;
  }

 private:
  DatasetOptions& Options() { return out_.config.dataset; }
  bool Exists(const char* name) const {
    std::error_code ignored;
    return fs::exists(dataset_ / name, ignored);
  }

  // `tutti generate` writes one, and a user may have; other programs have files of that name, too.
  bool HasConfiguration() const {
    std::error_code ignored;
    if (!fs::is_regular_file(dataset_ / kConfiguration, ignored)) return false;
    try {
      internal::TextReader in(dataset_ / kConfiguration);
      for (std::string line; in.Next(line);) {
        if (line.rfind("dataset:", 0) == 0) return true;
      }
    } catch (const InputError&) {  // no text, so none of ours
    }
    return false;
  }

  void Configured() {
    layout_ = std::string("as ") + kConfiguration + " in the folder says";
    source_ = kConfiguration;
    out_.config = LoadConfig(dataset_ / kConfiguration);
    out_.config.loops.ltm_file.clear();  // nobody gave this file: what it names is not written
    if (!sensor_) sensor_ = Options().sensor;
    if (request_.HasLens()) Requested(request_);
  }

  void Kitti() {
    const bool grey = HasImages(dataset_ / "image_0");
    const char* const right = grey ? "image_1" : "image_3";
    layout_ = std::string("KITTI (") + (grey ? "image_0" : "image_2");
    if (!sensor_ && HasImages(dataset_ / right)) {
      sensor_ = Sensor::kStereo;
      layout_ += std::string(", ") + right;
    }
    layout_ += ")";
    out_.config = Published(sensor_ == Sensor::kStereo ? "kitti_00-02_stereo" : "kitti_00-02_mono");
    ForgetCamera();
    SetLensOr(Exists("calib.txt") ? "calib.txt" : "");
    if (!Exists("calib.txt") && !IsApart())
      LeaveRightOut(
          Sensor::kMono,
          "a calib.txt has it, an ORB-SLAM file (--calibration), or --set camera.baseline_m=METRES");
  }

  void Tum() {
    const TumLists lists = TumListsOf(dataset_);
    const bool loris = std::string(lists.colour) == "color.txt";
    layout_ = std::string(loris ? "OpenLORIS (" : "TUM (") +
              (Exists(lists.colour) ? lists.colour : "associations.txt");
    const bool depth = Exists(lists.depth) || Exists("associations.txt");
    if (!sensor_) sensor_ = depth ? Sensor::kRgbd : Sensor::kMono;
    layout_ += Exists(lists.depth) ? std::string(", ") + lists.depth + ")" : ")";
    const std::string kind = sensor_ == Sensor::kRgbd ? "rgbd" : "mono";
    const std::string known = TumCamera();
    out_.config = Published((known.empty() ? "tum_fr3" : known) + "_" + kind);
    const std::optional<PinholeCamera> published = Options().camera;
    ForgetCamera();
    const LayoutCalibration own = ReadTumCalibration(dataset_);
    units_ = own.depth_units_per_m;
    if (known.empty()) Options().depth_units_per_m = 0;
    const bool of_the_folder = !known.empty() && !CalibrationBeside(dataset_);
    if (of_the_folder && !request_.HasLens()) Options().camera = published;
    SetLensOr(of_the_folder  ? "the one published for freiburg" + known.substr(6)
              : own.rig.left ? own.source
                             : "");
  }

  // The public data set's cameras are named in its folders.
  std::string TumCamera() const {
    const std::string name = fs::absolute(dataset_).lexically_normal().string();
    for (const char* number : {"1", "2", "3"}) {
      if (name.find(std::string("freiburg") + number) != std::string::npos)
        return std::string("tum_fr") + number;
    }
    return {};
  }

  void Euroc() {
    const fs::path base = HasImages(dataset_ / "mav0") ? dataset_ / "mav0" : dataset_;
    const bool pair = HasImages(base / "cam1" / "data");
    if (!sensor_) sensor_ = pair ? Sensor::kStereo : Sensor::kMono;
    layout_ = sensor_ == Sensor::kStereo ? "EuRoC (cam0, cam1)" : "EuRoC (cam0)";
    out_.config = Published(sensor_ == Sensor::kStereo ? "euroc_stereo" : "euroc_mono");
    SetLensOr("sensor.yaml");
  }

  // What suits the sensor, and the places where such data are recorded.
  const char* ConfigurationOf(const std::string& layout) const {
    if (layout == "KITTI raw") return sensor_ == Sensor::kStereo ? "kitti_00-02_stereo" : "kitti_00-02_mono";
    if (sensor_ == Sensor::kStereo) return "euroc_stereo";
    return sensor_ == Sensor::kRgbd ? "tum_fr3_rgbd" : "images";
  }

  void Paired() {
    const bool stray = IsStrayScanner(dataset_);
    const std::optional<FoundLayout> found = stray ? std::nullopt : FindLayout(dataset_);
    const std::string name = stray ? "Stray Scanner" : found->layout->name;
    const bool depth = stray ? HasImages(dataset_ / "depth") : found->depth;
    layout_ = stray ? name + (depth ? " (rgb.mp4, depth)" : " (rgb.mp4)") : found->Text();
    if (!sensor_) sensor_ = found && found->right ? Sensor::kStereo : depth ? Sensor::kRgbd : Sensor::kMono;
    if (found && found->right && depth && sensor_ == Sensor::kStereo)
      note_ = "--sensor rgbd uses the depth images";
    out_.config = Published(ConfigurationOf(name));
    ForgetCamera();
    Options().type = DatasetType::kPaired;
    Options().rate_hz = 0;
    Options().depth_units_per_m = 0;
    units_ = stray ? 1000 : found->layout->depth_units_per_m;
    if (name == "Replica" || name.rfind("TartanAir", 0) == 0)
      Options().max_depth_m = name == "Replica" ? 0 : 80;  // exact; the sky is at 10 km
    LayoutCalibration known;
    if (stray && Exists("camera_matrix.csv")) {
      known.source = "camera_matrix.csv";
      known.rig.left.emplace();
    } else if (found) {
      DatasetOptions any;
      any.type = DatasetType::kPaired;
      const PinholeCamera seen = OpenDataset(dataset_, any)->Rig().camera;
      known = ReadLayoutCalibration(dataset_, *found, cv::Size(seen.width, seen.height));
    }
    const auto file = found ? CalibrationOf(*found) : std::nullopt;
    if (file && !known.rig.left && !request_.HasLens()) {
      CameraRequest request;
      request.calibration = file;
      Requested(request);
    } else {
      SetLensOr(known.rig.left ? known.source : "");
    }
    if (!IsApart() && !(known.rig.baseline_m > 0) && !known.rig.right)
      LeaveRightOut(depth ? Sensor::kRgbd : Sensor::kMono,
                    "a calibration of both (--calibration) or --set camera.baseline_m=METRES says it");
  }

  std::optional<fs::path> CalibrationOf(const FoundLayout& found) const {
    for (const std::string& name : SplitText(found.layout->calibration, "|")) {
      if (Exists(name.c_str())) return dataset_ / name;
    }
    return std::nullopt;
  }

  void Single(DatasetType type, bool live) {
    const bool two = CameraSources(dataset_.string()).size() > 1;
    if (two && !sensor_)
      throw InputError(
          dataset_.string() +
          ": what are the two cameras? Give --sensor stereo (LEFT,RIGHT) or --sensor rgbd (COLOUR,DEPTH)");
    layout_ = live && IsStream(dataset_)     ? "a stream"
              : two                          ? "two cameras"
              : OpensOnce(dataset_)          ? "a video through a pipe"
              : live                         ? "a camera"
              : type == DatasetType::kImages ? "a folder of images"
              : type == DatasetType::kBag    ? "a ROS bag"
                                             : "a video";
    out_.config = Published("images");
    if (live && !two && sensor_ == Sensor::kStereo) layout_ += ", left and right side by side";
    if (type != DatasetType::kImages) Options().rate_hz = 0;  // its own
    if (type == DatasetType::kBag) units_ = 1000;             // REP 118
    if (!sensor_) sensor_ = Sensor::kMono;
    const bool device = IsCameraDevice(dataset_.string()) && !IsStream(dataset_.string());
    // A device without a lens: appearance only.
    if (!device || type == DatasetType::kBag || request_.HasLens())
      SetLensOr(type == DatasetType::kBag ? "camera_info" : "");
  }

  void ForgetCamera() {
    Options().camera.reset();
    Options().right.reset();
    Options().T_right_left = {};
    Options().baseline_m = 0;
  }
  // The distance of two cameras is known.
  bool IsApart() { return Options().baseline_m > 0 || Options().right; }
  // `advice`: where the distance of the two cameras may stand.
  void LeaveRightOut(Sensor other, const char* advice) {
    if (sensor_ != Sensor::kStereo) return;
    if (request_.sensor)
      throw InputError(dataset_.string() + ": the distance of the two cameras is not known; " + advice);
    sensor_ = other;
    note_ = "the right camera is not used: no file says how far apart the two are";
  }
  void Requested(const CameraRequest& request) {
    Options().sensor = sensor_.value_or(Sensor::kMono);
    source_ = SetRequested(dataset_, request, Options());
  }
  // The camera of the command line, else the one that is known from `source`, else one beside the images,
  // else a guess.
  void SetLensOr(const std::string& source) {
    if (request_.HasLens()) return Requested(request_);
    source_ = source;
    if (source_.empty()) BesideOrGuess();
  }
  void BesideOrGuess() {
    std::error_code ignored;
    const fs::path folder = fs::is_directory(dataset_, ignored) ? dataset_ : dataset_.parent_path();
    CameraRequest request;
    if (!IsStream(dataset_.string()) && !OpensOnce(dataset_)) request.calibration = CalibrationBeside(folder);
    if (!request.calibration) {
      request.view_deg = kUsualView;
      out_.guessed_lens = true;
    }
    Requested(request);
    if (!out_.guessed_lens) return;
    source_ = "guessed: a field of view of " + Short(kUsualView) + " deg";
    if (!OpensOnce(dataset_)) UsePhotos();
  }
  // The focal length of the first photo that has one, as a better guess.
  void UsePhotos() {
    constexpr std::size_t kLooked = 5;
    std::vector<fs::path> photos = ListImages(dataset_);
    if (photos.empty()) photos = ListImages(ImagesOfDataset(dataset_).value_or(dataset_));
    photos.resize(std::min(kLooked, photos.size()));
    PinholeCamera& camera = *Options().camera;
    for (const fs::path& photo : photos) {
      if (const std::optional<PhotoLens> lens = ReadPhotoLens(photo, camera.width, camera.height)) {
        camera.fx = camera.fy = lens->focal_px;
        source_ = out_.photo_lens = lens->text;
        return;
      }
    }
    if (!photos.empty() && HasUnreadLens(photos.front()))
      source_ += "; the photos may name one (EXIF), but this tutti was built without libexif";
  }

  void Say() {
    const bool live = IsCamera(dataset_.string());
    Options().sensor = sensor_.value_or(Sensor::kMono);
    if (request_.depth_units_per_m > 0) Options().depth_units_per_m = request_.depth_units_per_m;
    std::string sensor = "one camera";
    std::string other;
    if (Options().sensor == Sensor::kStereo) {
      sensor = "stereo";
      if (!live) other = "; --sensor mono uses the left camera alone";
    } else if (Options().sensor == Sensor::kRgbd) {
      const double units = Options().depth_units_per_m > 0 ? Options().depth_units_per_m : units_;
      sensor = "RGB-D, " + (units > 0 ? Short(units) + " units of depth a metre"
                                      : "5000 units of depth a metre assumed, as TUM has them");
      if (units == 1) sensor = "RGB-D, depth in metres";
      other = units > 0 ? " (--set dataset.depth_units_per_m=... for another)"
                        : " (--set dataset.depth_units_per_m=1000 for millimetres)";
      if (!live) other += "; --sensor mono uses colour alone";
    }
    if (!note_.empty()) other += "; " + note_;
    std::string camera = source_.empty() ? "not known: loops, but no trajectory" : source_;
    if (Options().camera) {
      const PinholeCamera& c = *Options().camera;
      char text[160];
      const std::string lens =
          c.distortion == Distortion::kNone ? "" : std::string(", ") + WordOf(c.distortion);
      std::snprintf(text, sizeof text, "fx %.1f, fy %.1f%s (", c.fx, c.fy, lens.c_str());
      camera = text + camera + ")";
      if (c.width > 0) camera = std::to_string(c.width) + "x" + std::to_string(c.height) + " px, " + camera;
    }
    out_.findings = {
        "layout  " + layout_ + "; --set dataset.type=... for another", "sensor  " + sensor + other,
        "camera  " + camera + "; --calibration FILE, --camera fx,fy,cx,cy or --fov DEG for another"};
  }

  const fs::path& dataset_;
  const CameraRequest& request_;
  std::optional<Sensor> sensor_;
  Recording out_;
  std::string layout_, source_, note_;
  double units_ = 0;  // of depth, that the layout has; 0: not known
};

}  // namespace

Recording Recognise(const fs::path& dataset, const CameraRequest& camera) {
  return Recogniser(dataset, camera).Make();
}

void SetCamera(const fs::path& dataset, const CameraRequest& camera, RunConfig& config) {
  if (camera.sensor) config.dataset.sensor = *camera.sensor;
  if (camera.HasLens()) SetRequested(dataset, camera, config.dataset);
}

}  // namespace tutti
