// tutti.Dataset, and the frames and rigs that it gives.
#include "tutti/frontend/dataset.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <optional>
#include <string>
#include <utility>

#include "apps/python/arrays.h"
#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "apps/python/pickled.h"
#include "tutti/core/text.h"
#include "tutti/loopclosure/features.h"

namespace tutti::python {
namespace {

namespace fs = std::filesystem;

// From Python, whose arrays may change: the map needs the images later.
InputFrame MakeFrame(const py::object& image, double stamp, std::int64_t index, const py::object& right,
                     const py::object& depth, const py::object& mask, bool rgb, const py::object& imu) {
  if (image.is_none())
    throw py::type_error(
        "image is None, which cv2.imread returns for a file that it can't read; give an array");
  InputFrame frame;
  frame.index = index;
  frame.stamp_s = stamp;
  const ImageView left_view = ViewOfImage(image, "image", rgb), right_view = ViewOfImage(right, "right", rgb);
  const ImageView depth_view = ViewOfDepth(depth, "depth"), mask_view = ViewOfMask(mask, "mask");
  const cv::Size size = left_view.pixels.size();
  if (size.empty()) throw py::value_error("image: a frame needs one");
  for (const auto& [other, name] :
       {std::pair(&right_view, "right"), {&depth_view, "depth"}, {&mask_view, "mask"}}) {
    if (!other->pixels.empty() && other->pixels.size() != size)
      throw py::value_error(std::string(name) + " must be as large as image");
  }
  frame.image = ToGrey8(left_view.pixels).clone();
  frame.right = ToGrey8(right_view.pixels).clone();
  frame.depth_m = depth_view.pixels.clone();
  frame.mask = mask_view.pixels.clone();
  if (imu.is_none()) return frame;
  const py::array_t<double> rows = RowsOf(imu, "imu", {7});
  const auto at = rows.unchecked<2>();
  for (py::ssize_t i = 0; i < at.shape(0); ++i)
    frame.imu.push_back({at(i, 0), {at(i, 1), at(i, 2), at(i, 3)}, {at(i, 4), at(i, 5), at(i, 6)}});
  return frame;
}

CameraRig MakeRig(const PinholeCamera& camera, const std::string& sensor, double baseline_m, double rate_hz,
                  double max_depth_m, double readout_s, double depth_delay_s,
                  const py::object& T_camera_imu) {
  CameraRig rig;
  rig.camera = camera;
  rig.sensor = SensorNamed("Rig", sensor);
  if (camera.distortion != Distortion::kNone)
    throw InputError("Rig: images must be rectified, so the camera can have no distortion");
  rig.baseline_m = baseline_m;
  rig.rate_hz = rate_hz;
  rig.max_depth_m = max_depth_m;
  rig.readout_s = readout_s;
  rig.depth_delay_s = depth_delay_s;
  if (!T_camera_imu.is_none()) rig.imu.emplace().T_camera_imu = PoseOf(T_camera_imu, "T_camera_imu");
  return rig;
}

/// A data set and what it says to whoever reads it.
class Reader {
 public:
  Reader(const fs::path& path, const std::optional<RunConfig>& config, const py::object& camera,
         const py::kwargs& keywords) {
    RunConfig all = config.value_or(RunConfig());
    if (py::isinstance<PinholeCamera>(camera)) {
      all.dataset.camera = camera.cast<PinholeCamera>();
    } else if (!camera.is_none()) {
      SetOptions("Dataset: camera", "camera", camera.cast<py::dict>(), all);
    }
    SetOptions("Dataset", "dataset", keywords, all);
    const py::gil_scoped_release release;
    dataset_ = IsCamera(path.string()) ? OpenDataset(path, all.dataset)
                                       : Reading(path, [&] { return OpenDataset(path, all.dataset); });
  }

  const Dataset& dataset() const { return *dataset_; }

  /// Frame i, counted from the end if negative, as Python does. Raises IndexError if there is none.
  InputFrame At(std::int64_t i) const {
    ReadResult read = Read(Place(i));
    if (!read.frame) throw FileError(read.error);
    if (!read.depth_error.empty()) Warn(read.depth_error);
    return *std::move(read.frame);
  }
  py::object Colour(std::int64_t i) const {
    const std::size_t place = Place(i);
    ColourImage read;
    {
      const py::gil_scoped_release release;
      read = dataset_->ReadColour(place);
    }
    if (!read.error.empty()) throw FileError(read.error);
    return ArrayOfImage(read.image);
  }
  double Stamp(std::int64_t i) const { return dataset_->Stamp(Place(i)); }

  /// The first frame from `place` on that can be read; `place` is then that of the next one.
  InputFrame Next(std::size_t& place) const {
    while (WaitFor(place)) {
      ReadResult read = Read(place++);
      if (!read.frame || !read.depth_error.empty()) Warn(read.frame ? read.depth_error : read.error);
      if (read.frame) return *std::move(read.frame);
    }
    throw py::stop_iteration();
  }

 private:
  std::size_t Place(std::int64_t i) const {
    const auto size = static_cast<std::int64_t>(dataset_->Size());
    const std::int64_t place = i < 0 ? size + i : i;
    if (place < 0 || place >= size)
      throw py::index_error("frame " + std::to_string(i) + ": the data set has " + std::to_string(size));
    return static_cast<std::size_t>(place);
  }

  ReadResult Read(std::size_t i) const {
    const py::gil_scoped_release release;
    return dataset_->Read(i);
  }

  // Waits where the data set grows; Ctrl-C ends it.
  bool WaitFor(std::size_t i) const {
    Interrupts interrupts;
    bool there = false;
    {
      const py::gil_scoped_release release;
      there = dataset_->WaitFor(i, [&] { return interrupts.Came(); });
    }
    interrupts.Rethrow();
    return there;
  }

  std::unique_ptr<const Dataset> dataset_;
};

/// Where somebody is in a data set.
struct FrameIterator {
  const Reader* reader;
  std::size_t place = 0;
};

void BindFrame(py::module_& module) {
  using namespace pybind11::literals;  // NOLINT(google-build-using-namespace)
  py::class_<InputFrame>(module, "Frame", doc::InputFrame)
      .def(Pickled<InputFrame>())
      .def(py::init(&MakeFrame), "image"_a, "stamp"_a, "index"_a = 0, py::kw_only(), "right"_a = py::none(),
           "depth"_a = py::none(), "mask"_a = py::none(), "rgb"_a = false, "imu"_a = py::none(),
           "From arrays, which are copied; colour becomes grey. Rectified: the rig's camera has no "
           "distortion. image, right: uint8 (H, W) or (H, W, 3), blue, green, red unless rgb. depth: float32 "
           "(H, W) [m], 0 = unknown. mask: uint8 or bool (H, W); there are no features where it is 0. index "
           "grows. imu: (N, 7), an IMU's measurements since the frame before: stamp [s], angular velocity x, "
           "y, z [rad/s], acceleration x, y, z [m/s^2], with gravity.")
      .def_readonly("index", &InputFrame::index, doc::InputFrame_index)
      .def_readonly("stamp", &InputFrame::stamp_s, doc::InputFrame_stamp_s)
      .def_property_readonly(
          "image", [](const InputFrame& frame) { return ArrayOfImage(frame.image); },
          "uint8 (H, W), left (or only) camera; a read-only view.")
      .def_property_readonly(
          "right", [](const InputFrame& frame) { return ArrayOfImage(frame.right); },
          "Stereo: uint8 (H, W); else, or where it is absent, None.")
      .def_property_readonly(
          "depth", [](const InputFrame& frame) { return ArrayOfImage(frame.depth_m); },
          "RGB-D: float32 (H, W) [m], registered to image, 0 = no measurement; else, or where it is absent, "
          "None.")
      .def_property_readonly(
          "mask", [](const InputFrame& frame) { return ArrayOfImage(frame.mask); },
          "uint8 (H, W); there are no features where it is 0. None: everywhere.")
      .def_property_readonly(
          "imu",
          [](const InputFrame& frame) {
            Eigen::MatrixXd rows(static_cast<Eigen::Index>(frame.imu.size()), 7);
            for (Eigen::Index i = 0; i < rows.rows(); ++i) {
              const ImuSample& sample = frame.imu[static_cast<std::size_t>(i)];
              rows.row(i) << sample.stamp_s, sample.gyro.transpose(), sample.acceleration.transpose();
            }
            return ArrayOf(rows);
          },
          "(N, 7): stamp [s], angular velocity [rad/s], acceleration [m/s^2] of an IMU since the frame "
          "before.")
      .def("__repr__", [](const InputFrame& frame) {
        return py::str("Frame(index={}, stamp={}, size={}x{})")
            .format(frame.index, frame.stamp_s, frame.image.cols, frame.image.rows);
      });
}

void BindRig(py::module_& module) {
  using namespace pybind11::literals;  // NOLINT(google-build-using-namespace)
  const CameraRig defaults;
  py::class_<CameraRig>(module, "Rig", doc::CameraRig)
      .def(Pickled<CameraRig>())
      .def(py::init(&MakeRig), "camera"_a, "sensor"_a = WordOf(defaults.sensor), py::kw_only(),
           "baseline_m"_a = defaults.baseline_m, "rate_hz"_a = defaults.rate_hz,
           "max_depth_m"_a = defaults.max_depth_m, "readout_s"_a = defaults.readout_s,
           "depth_delay_s"_a = defaults.depth_delay_s, "T_camera_imu"_a = py::none(),
           "sensor: mono, stereo or rgbd. The camera is that of rectified images. T_camera_imu: how an "
           "IMU is mounted, (4, 4) or x, y, z, qx, qy, qz, qw; None: it is measured.")
      .def_property_readonly(
          "sensor", [](const CameraRig& rig) { return WordOf(rig.sensor); }, "mono, stereo or rgbd")
      .def_readonly("camera", &CameraRig::camera, doc::CameraRig_camera)
      .def_readonly("baseline_m", &CameraRig::baseline_m, doc::CameraRig_baseline_m)
      .def_readonly("rate_hz", &CameraRig::rate_hz, doc::CameraRig_rate_hz)
      .def_readonly("max_depth_m", &CameraRig::max_depth_m, doc::CameraRig_max_depth_m)
      .def_readonly("readout_s", &CameraRig::readout_s, doc::CameraRig_readout_s)
      .def_readonly("depth_delay_s", &CameraRig::depth_delay_s, doc::CameraRig_depth_delay_s)
      .def_readonly("calibrated", &CameraRig::calibrated, doc::CameraRig_calibrated)
      .def_property_readonly(
          "T_camera_imu",
          [](const CameraRig& rig) -> py::object {
            if (!rig.imu || !rig.imu->T_camera_imu) return py::none();
            return ArrayOf(*rig.imu->T_camera_imu);
          },
          "(4, 4): from the IMU to the camera; None: not known.")
      .def_property_readonly(
          "T_body_camera", [](const CameraRig& rig) { return ArrayOf(rig.T_body_camera); },
          (std::string("(4, 4): ") + doc::CameraRig_T_body_camera).c_str());
}

py::array_t<double> GroundTruth(const Reader& reader, std::optional<fs::path> file) {
  const Dataset& dataset = reader.dataset();
  if (!file) file = dataset.GroundTruthFile();
  if (!file) throw FileError("the data set has no ground truth; give its file");
  std::vector<std::string> warnings;
  const Trajectory trajectory = Reading(*file, [&] { return dataset.ReadGroundTruth(*file, &warnings); });
  for (const std::string& warning : warnings) Warn(warning);
  return ArrayOf(trajectory);
}

}  // namespace

void BindDataset(py::module_& module) {
  using namespace pybind11::literals;  // NOLINT(google-build-using-namespace)
  BindFrame(module);
  BindRig(module);
  py::class_<FrameIterator>(module, "FrameIterator", "Gives a data set's frames in their order.")
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__", [](FrameIterator& self) { return self.reader->Next(self.place); });
  const std::string text =
      std::string("for frame in Dataset(path): ...\n\n") + doc::Dataset + "\n\n" + doc::OpenDataset +
      "\n\nThe iterator leaves out frames that can't be read, with a warning that names the file; dataset[i] "
      "raises tutti.FileError for them.\n\ncamera: tutti.Camera or a dict of its keywords; config: "
      "tutti.Config, whose sections dataset and camera are used. Keywords:\n" +
      DescribeOptions("dataset");
  py::class_<Reader>(module, "Dataset", text.c_str())
      .def(py::init<const fs::path&, const std::optional<RunConfig>&, const py::object&, const py::kwargs&>(),
           "path"_a, "config"_a = py::none(), py::kw_only(), "camera"_a = py::none(), doc::OpenDataset)
      .def(
          "__iter__",
          [](const Reader& reader) {
            return FrameIterator{&reader, 0};
          },
          py::keep_alive<0, 1>())
      .def("__len__", [](const Reader& reader) { return reader.dataset().Size(); })
      .def("__getitem__", &Reader::At, "i"_a)
      .def("stamp", &Reader::Stamp, "i"_a, doc::Dataset_Stamp)
      .def("colour", &Reader::Colour, "i"_a,
           (std::string("uint8 (H, W, 3), blue, green, red. ") + doc::Dataset_ReadColour).c_str())
      .def("ground_truth", &GroundTruth, "file"_a = py::none(),
           (std::string("(N, 8): stamp [s], x, y, z [m], qx, qy, qz, qw; T_world_body. file: None for that "
                        "in its usual place in the folder. ") +
            "Poses of KITTI get the data set's stamps, and must be as many. A time stamp that stands there "
            "twice keeps its first pose, with a warning. Raises tutti.InputError with file and line.")
               .c_str())
      .def_property_readonly(
          "rig", [](const Reader& reader) { return reader.dataset().Rig(); }, doc::Dataset_Rig)
      .def_property_readonly(
          "ground_truth_file", [](const Reader& reader) { return reader.dataset().GroundTruthFile(); },
          doc::Dataset_GroundTruthFile)
      .def_property_readonly(
          "warnings", [](const Reader& reader) { return reader.dataset().Warnings(); },
          doc::Dataset_Warnings);
}

Sensor SensorNamed(const std::string& function, const std::string& name) {
  std::vector<std::string> words;
  for (const auto& [word, value] : WordsOf(Sensor())) {
    if (name == word) return value;
    words.emplace_back(word);
  }
  throw InputError(function + ": sensor: '" + name + "' is not one of " + JoinText(words));
}

}  // namespace tutti::python
