// tutti.LoopDetector
#include "tutti/loopclosure/detector.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <optional>

#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "apps/python/guarded.h"
#include "apps/python/loop_query.h"
#include "apps/python/options.h"
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

std::unique_ptr<Detector> MakeDetector(const MemberNames& external, const MemberNames& dense,
                                       const py::kwargs& keywords) {
  RunConfig config;
  config.loops.external_members = external;
  config.loops.dense_members = dense;
  SetOptions("LoopDetector", "loops", keywords, config);
  const auto make = [&] {
    const py::gil_scoped_release release;
    return std::make_unique<Detector>(LoopDetector(config.loops));
  };
  return make();
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
  config.loops = self.Run([](LoopDetector& detector) { return detector.options(); });
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
      .def(
          "begin_session", [](Detector& self) { self.Run([](LoopDetector& d) { d.BeginSession(); }); },
          doc::LoopDetector_BeginSession)
      .def(
          "add_link",
          [](Detector& self, std::int64_t a, std::int64_t b) {
            self.Run([&](LoopDetector& d) { d.AddLink(a, b); });
          },
          "a"_a, "b"_a, doc::LoopDetector_AddLink)
      .def(
          "unlink",
          [](Detector& self, std::int64_t a, std::int64_t b) {
            self.Run([&](LoopDetector& d) { d.Unlink(a, b); });
          },
          "a"_a, "b"_a, doc::LoopDetector_Unlink)
      .def(
          "merge",
          [](Detector& self, std::int64_t id, std::int64_t into) {
            return self.Run([&](LoopDetector& d) { return d.Merge(id, into); });
          },
          "id"_a, "into"_a, doc::LoopDetector_Merge)
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
      .def_property_readonly(
          "num_locations",
          [](Detector& self) { return self.Run([](LoopDetector& d) { return d.NumLocations(); }); },
          doc::LoopDetector_NumLocations)
      .def_property_readonly(
          "num_long_term",
          [](Detector& self) { return self.Run([](LoopDetector& d) { return d.NumLongTerm(); }); },
          doc::LoopDetector_NumLongTerm)
      .def_property_readonly(
          "last_id", [](Detector& self) { return self.Run([](LoopDetector& d) { return d.LastId(); }); },
          doc::LoopDetector_LastId)
      .def_property_readonly("options", &DetectorOptions, doc::LoopDetector_options);
}

}  // namespace tutti::python
