// tutti.LoopDetector
#include "tutti/loopclosure/detector.h"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/python/arrays.h"
#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "apps/python/pickled.h"

namespace tutti::python {
namespace {

using Detector = Guarded<LoopDetector>;

constexpr const char* kArguments =
    "\n\nimage: uint8 (H, W), uint8 (H, W, 3) or uint16 (H, W); colour is blue, green, red, as cv2.imread "
    "gives it, or red, green, blue with rgb=True. Not copied if its rows are contiguous.\n"
    "depth: float32 (H, W) [m], registered to the image, 0 = unknown.\n"
    "camera: tutti.Camera; without it a loop comes without a pose.\n"
    "mask: uint8 or bool (H, W); there are no features where it is 0.\n"
    "member_features: {name: (keypoints, descriptors)} of members that need not extract; keypoints (N, 2) of "
    "x, y [px] (more columns: size, angle [deg], response), descriptors (N, D) of uint8 (Hamming) or float32 "
    "(Euclidean). Of dense_members {name: vector of float32}.\n"
    "features: (keypoints, descriptors) or (keypoints, descriptors, points) of your own for the "
    "verification; points (N, 3) in the camera frame [m], NaN where unknown.\n"
    "pose_prior: tutti.PosePrior. metric: false if the scale of the points drifts (one camera). stamp: [s], "
    "for your own records.";

/// A query, and the arrays whose pixels it has.
struct QueryOf {
  LoopQuery query;
  std::vector<py::object> owners;
};

/// What Python gives beside the id; None: not given.
struct QueryArguments {
  py::object image, depth, mask, camera, member_features, features, pose_prior;
  double stamp;
  bool metric, rgb;
};

// (N, 2) to (N, 5): x, y, size, angle, response.
std::vector<cv::KeyPoint> KeypointsOf(const py::object& object, const std::string& name) {
  if (object.is_none()) return {};
  const py::array_t<double> rows = RowsOf(object, name, {2, 3, 4, 5});
  std::vector<cv::KeyPoint> keypoints;
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const auto at = [&](int column, float otherwise) {
      return column < rows.shape(1) ? static_cast<float>(rows.at(i, column)) : otherwise;
    };
    keypoints.emplace_back(at(0, 0), at(1, 0), at(2, 1), at(3, -1), at(4, 0));
  }
  return keypoints;
}

Features FeaturesOf(const py::handle& object, const std::string& name) {
  const std::string of = "member_features['" + name + "']";
  Features features;
  if (py::isinstance<py::array>(object)) {  // of the image as a whole
    const auto vector = py::reinterpret_borrow<py::array>(object);
    const py::object row = vector.ndim() == 1 ? vector.attr("reshape")(1, -1) : py::object(vector);
    features.descriptors = DescriptorsOf(row, of.c_str());
    return features;
  }
  if (!py::isinstance<py::tuple>(object) || py::len(object) != 2)
    throw py::type_error(of + " must be (keypoints, descriptors), or one vector for a dense member");
  const auto pair = py::reinterpret_borrow<py::tuple>(object);
  features.keypoints = KeypointsOf(pair[0], of + ": keypoints");
  features.descriptors = DescriptorsOf(pair[1], (of + ": descriptors").c_str());
  return features;
}

// (keypoints, descriptors) or (keypoints, descriptors, points).
FeatureSet FeatureSetOf(const py::object& object) {
  if (!py::isinstance<py::tuple>(object) || py::len(object) < 2 || py::len(object) > 3)
    throw py::type_error("features must be (keypoints, descriptors) or (keypoints, descriptors, points)");
  const auto parts = py::reinterpret_borrow<py::tuple>(object);
  FeatureSet set;
  set.keypoints = KeypointsOf(parts[0], "features: keypoints");
  set.descriptors = DescriptorsOf(parts[1], "features: descriptors");
  if (parts.size() == 3 && !parts[2].is_none()) {
    const py::array_t<double> points = RowsOf(parts[2], "features: points", {3});
    for (py::ssize_t i = 0; i < points.shape(0); ++i)
      set.points.emplace_back(points.at(i, 0), points.at(i, 1), points.at(i, 2));
  }
  return set;
}

// Raises TypeError or ValueError that names the argument.
QueryOf MakeQuery(std::int64_t id, const QueryArguments& arguments) {
  QueryOf made;
  LoopQuery& query = made.query;
  query.id = id;
  query.stamp_s = arguments.stamp;
  query.metric = arguments.metric;
  const auto keep = [&made](ImageView view) {
    made.owners.push_back(std::move(view.owner));
    return view.pixels;
  };
  if (arguments.image.is_none() && arguments.member_features.is_none())
    throw py::type_error(
        "image is None, which cv2.imread returns for a file that it can't read; give an array, or "
        "member_features instead of an image");
  query.image = keep(ViewOfImage(arguments.image, "image", arguments.rgb));
  query.depth_m = keep(ViewOfDepth(arguments.depth, "depth"));
  query.mask = keep(ViewOfMask(arguments.mask, "mask"));
  if (!arguments.camera.is_none()) query.camera = arguments.camera.cast<PinholeCamera>();
  if (!arguments.features.is_none()) query.features = FeatureSetOf(arguments.features);
  if (!arguments.pose_prior.is_none()) query.pose_prior = arguments.pose_prior.cast<PosePrior>();
  if (!arguments.member_features.is_none()) {
    if (!py::isinstance<py::dict>(arguments.member_features))
      throw py::type_error("member_features must be a dict: name -> (keypoints, descriptors)");
    for (const auto& [name, features] : py::reinterpret_borrow<py::dict>(arguments.member_features)) {
      const auto word = name.cast<std::string>();
      query.member_features[word] = FeaturesOf(features, word);
    }
  }
  return made;
}

std::unique_ptr<Detector> MakeDetector(const MemberNames& external, const MemberNames& dense,
                                       const py::kwargs& keywords) {
  RunConfig config;
  config.loops.external_members = external;
  config.loops.dense_members = dense;
  SetOptions("LoopDetector", "loops", keywords, config);
  const py::gil_scoped_release release;
  return std::make_unique<Detector>(LoopDetector(config.loops));
}

LoopResult Detect(Detector& self, const py::object& image, std::optional<std::int64_t> id,
                  const py::object& depth, const py::object& camera, const py::object& mask,
                  const py::object& member_features, const py::object& features, const py::object& pose_prior,
                  double stamp, bool metric, bool rgb) {
  QueryOf made = MakeQuery(id.value_or(-1), {image, depth, mask, camera, member_features, features,
                                             pose_prior, stamp, metric, rgb});
  return self.Run([&](LoopDetector& detector) {
    if (!id) made.query.id = detector.LastId() + 1;
    return detector.Detect(made.query);
  });
}

LoopResult Locate(Detector& self, const py::object& image, const py::object& depth, const py::object& camera,
                  const py::object& mask, const py::object& member_features, const py::object& features,
                  const py::object& pose_prior, double stamp, bool metric, bool rgb) {
  const QueryOf made =
      MakeQuery(0, {image, depth, mask, camera, member_features, features, pose_prior, stamp, metric, rgb});
  return self.Run([&](LoopDetector& detector) {
    LoopQuery query = made.query;
    query.id = detector.LastId() + 1;
    return detector.Locate(query);
  });
}

py::dict DetectorOptions(Detector& self) {
  RunConfig config;
  config.loops = Locked(&LoopDetector::options)(self);
  py::dict options = OptionsOf(config, "loops");
  options["external_members"] = config.loops.external_members;
  options["dense_members"] = config.loops.dense_members;
  return options;
}

void BindPosePrior(py::module_& module) {
  const PosePrior defaults;
  py::class_<PosePrior>(module, "PosePrior", doc::PosePrior)
      .def(py::init(
               [](const std::array<double, 3>& position_m, std::int64_t frame, double sigma_m, double drift) {
                 PosePrior prior;
                 prior.position_m = Eigen::Vector3d(position_m[0], position_m[1], position_m[2]);
                 prior.frame = frame;
                 prior.sigma_m = sigma_m;
                 prior.drift = drift;
                 return prior;
               }),
           py::arg("position_m"), py::arg("frame") = defaults.frame, py::arg("sigma_m") = defaults.sigma_m,
           py::arg("drift") = defaults.drift)
      .def(Pickled<PosePrior>())
      .def_property_readonly(
          "position_m",
          [](const PosePrior& prior) {
            return std::array<double, 3>{prior.position_m.x(), prior.position_m.y(), prior.position_m.z()};
          },
          doc::PosePrior_position_m)
      .def_readonly("frame", &PosePrior::frame, doc::PosePrior_frame)
      .def_readonly("sigma_m", &PosePrior::sigma_m, doc::PosePrior_sigma_m)
      .def_readonly("drift", &PosePrior::drift, doc::PosePrior_drift);
}

}  // namespace

void BindLoopDetector(py::module_& module) {
  BindPosePrior(module);
  using namespace pybind11::literals;  // NOLINT(google-build-using-namespace)
  const std::string text =
      std::string(doc::LoopDetector) +
      " Several Python threads may call; one works, the others wait.\n\nKeywords, all optional, with their "
      "defaults (external_members, dense_members: names of members whose features you give to detect):\n" +
      DescribeOptions("loops");
  py::class_<Detector>(module, "LoopDetector", text.c_str())
      .def(py::init(&MakeDetector), py::kw_only(), "external_members"_a = MemberNames(),
           "dense_members"_a = MemberNames(), doc::LoopDetector_LoopDetector)
      .def("detect", &Detect, "image"_a = py::none(), "id"_a = py::none(), py::kw_only(),
           "depth"_a = py::none(), "camera"_a = py::none(), "mask"_a = py::none(),
           "member_features"_a = py::none(), "features"_a = py::none(), "pose_prior"_a = py::none(),
           "stamp"_a = 0.0, "metric"_a = true, "rgb"_a = false,
           (std::string(doc::LoopDetector_Detect) + " id: None takes last_id + 1." + kArguments).c_str())
      .def("locate", &Locate, "image"_a = py::none(), py::kw_only(), "depth"_a = py::none(),
           "camera"_a = py::none(), "mask"_a = py::none(), "member_features"_a = py::none(),
           "features"_a = py::none(), "pose_prior"_a = py::none(), "stamp"_a = 0.0, "metric"_a = true,
           "rgb"_a = false, (std::string(doc::LoopDetector_Locate) + kArguments).c_str())
      .def("begin_session", Locked(&LoopDetector::BeginSession), doc::LoopDetector_BeginSession)
      .def("add_link", Locked(&LoopDetector::AddLink), "a"_a, "b"_a, doc::LoopDetector_AddLink)
      .def("unlink", Locked(&LoopDetector::Unlink), "a"_a, "b"_a, doc::LoopDetector_Unlink)
      .def("merge", Locked(&LoopDetector::Merge), "id"_a, "into"_a, doc::LoopDetector_Merge)
      .def(
          "save",
          [](Detector& self, const std::filesystem::path& file) {
            Writing([&] { self.Run([&](LoopDetector& d) { d.Save(file); }); });
          },
          "file"_a, doc::LoopDetector_Save)
      .def(
          "load",
          [](Detector& self, const std::filesystem::path& file) {
            Reading(file, [&] { self.Run([&](LoopDetector& d) { d.Load(file); }); });
          },
          "file"_a, doc::LoopDetector_Load)
      .def_property_readonly("num_locations", Locked(&LoopDetector::NumLocations),
                             doc::LoopDetector_NumLocations)
      .def_property_readonly("num_long_term", Locked(&LoopDetector::NumLongTerm),
                             doc::LoopDetector_NumLongTerm)
      .def_property_readonly("last_id", Locked(&LoopDetector::LastId), doc::LoopDetector_LastId)
      .def_property_readonly("options", &DetectorOptions, doc::LoopDetector_options);
}

}  // namespace tutti::python
