// tutti.TrajectoryCloser and tutti.close: loops for the odometry that a program already has.
#include "tutti/slam/trajectory_closer.h"

#include <pybind11/stl.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "apps/python/arrays.h"
#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "apps/slam/odometry_jumps.h"
#include "tutti/backend/evaluation.h"

namespace tutti::python {
namespace {

std::unique_ptr<TrajectoryCloser> MakeCloser(const CameraRig& rig, const std::optional<RunConfig>& config,
                                             const py::dict& sections) {
  RunConfig all = config.value_or(RunConfig());
  SetOptions("TrajectoryCloser", "", sections, all);
  const py::gil_scoped_release release;
  return std::make_unique<TrajectoryCloser>(all, rig);
}

TrackResult Push(TrajectoryCloser& closer, const InputFrame& frame, const py::object& T_odom_body,
                 const std::optional<std::pair<double, double>>& sigma) {
  const Pose pose = PoseOf(T_odom_body, "T_odom_body");
  std::optional<MotionSigma> of_motion;
  if (sigma) of_motion = {sigma->first, sigma->second};
  const py::gil_scoped_release release;
  return closer.Push(frame, pose, of_motion);
}

py::array_t<double> Corrected(const TrajectoryCloser& closer, const py::object& odometry) {
  const Trajectory given = TrajectoryOf(odometry, "odometry");
  return ArrayOf(Free(&TrajectoryCloser::Corrected)(closer, given));
}

std::unique_ptr<TrajectoryCloser> Close(const py::object& odometry, const py::object& dataset,
                                        const std::optional<RunConfig>& config, double max_gap_s) {
  const Trajectory given = TrajectoryOf(odometry, "odometry");
  if (!(max_gap_s > 0)) throw InputError("close: max_gap_s must be above 0");
  const std::vector<OdometryJump> jumps = FindJumps(given);
  const Trajectory inliers = WithoutOutliers(given, jumps);
  for (const OdometryJump& jump : jumps) {
    if (jump.comes_back) Warn(Sentence(jump));
  }
  auto closer = MakeCloser(dataset.attr("rig").cast<CameraRig>(), config, {});
  bool pushed = false;
  for (const py::handle item : dataset) {
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    const auto frame = item.cast<InputFrame>();
    const std::optional<Pose> pose = InterpolatePose(inliers, frame.stamp_s, max_gap_s);
    if (!pose) continue;
    pushed = true;
    const py::gil_scoped_release release;
    closer->Push(frame, *pose);
  }
  if (!pushed)
    throw InputError(
        "close: odometry has no pose for any image; check the unit and the clock of its time stamps");
  Free (&TrajectoryCloser::Finish)(*closer);
  for (const std::string& warning : closer->TakeWarnings()) Warn(warning);
  return closer;
}

}  // namespace

void BindTrajectoryCloser(py::module_& module) {
  using namespace pybind11::literals;  // NOLINT(google-build-using-namespace)
  const std::string text = std::string(doc::TrajectoryCloser) +
                           "\n\nTrajectoryCloser(dataset.rig, config, run={\"threads\": 1}): sections of the "
                           "configuration are keywords, as in Config.";
  py::class_<TrajectoryCloser>(module, "TrajectoryCloser", text.c_str())
      .def(py::init([](const CameraRig& rig, const std::optional<RunConfig>& config,
                       const py::kwargs& sections) { return MakeCloser(rig, config, sections); }),
           "rig"_a, "config"_a = py::none(),
           "Raises tutti.InputError if the configuration does not fit the rig.")
      .def("push", &Push, "frame"_a, "T_odom_body"_a, "sigma"_a = py::none(),
           (std::string("`T_odom_body`: (4, 4), or (7,) of x, y, z [m], qx, qy, qz, qw. `sigma`: "
                        "(translation [m], rotation [rad]), on each axis.\n\n") +
            doc::TrajectoryCloser_Push)
               .c_str())
      .def("finish", Free(&TrajectoryCloser::Finish), doc::TrajectoryCloser_Finish)
      .def_property_readonly(
          "T_map_odom",
          [](const TrajectoryCloser& c) { return ArrayOf(Free(&TrajectoryCloser::T_map_odom)(c)); },
          (std::string("(4, 4) float64. ") + doc::TrajectoryCloser_T_map_odom).c_str())
      .def("corrected", &Corrected, "odometry"_a,
           (std::string(
                "`odometry` and what is returned: (N, 8) of stamp [s], x, y, z [m], qx, qy, qz, qw.\n\n") +
            doc::TrajectoryCloser_Corrected)
               .c_str())
      .def(
          "keyframes",
          [](const TrajectoryCloser& c) { return ArrayOf(Free(&TrajectoryCloser::Keyframes)(c)); },
          (std::string("(N, 8), as corrected. ") + doc::TrajectoryCloser_Keyframes).c_str())
      .def_property_readonly("loops", Free(&TrajectoryCloser::Loops), doc::TrajectoryCloser_Loops)
      .def(
          "graph",
          [](const TrajectoryCloser& c) {
            return std::make_unique<Guarded<PoseGraph>>(Free(&TrajectoryCloser::Graph)(c));
          },
          doc::TrajectoryCloser_Graph)
      .def_property_readonly("corrections", Free(&TrajectoryCloser::Corrections),
                             doc::TrajectoryCloser_Corrections)
      .def("take_warnings", Free(&TrajectoryCloser::TakeWarnings), doc::TrajectoryCloser_TakeWarnings);
  module.def("close", &Close, "odometry"_a, "dataset"_a, "config"_a = py::none(), "max_gap_s"_a = 1.0,
             "Loops for a whole recording: pushes each frame of `dataset` (Dataset) with the pose that "
             "`odometry` has at its time, and finishes. `odometry`: (N, 8) of stamp [s], x, y, z [m], qx, "
             "qy, qz, qw; T_odom_body. Poses are interpolated where they are at most `max_gap_s` [s] apart; "
             "other frames are left out. Returns the TrajectoryCloser: corrected(odometry) is the corrected "
             "trajectory. Warns if the images show that the odometry is less certain than configured. Raises "
             "tutti.InputError if no frame has a pose.");
}

}  // namespace tutti::python
