// tutti.recognise: what `tutti run` finds out about a recording before it runs.
#include "apps/run/recording.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "apps/run/focal_length.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::python {
namespace {

namespace fs = std::filesystem;

// Where nothing says what the focal length is, the images may; the sentence says what came of it.
std::string MeasureLens(const fs::path& dataset, Recording* recording) {
  if (IsCamera(dataset.string())) return "focal length guessed: live frames can't be measured before";
  const FocalLength found = MeasureFocalLength(dataset, recording->config);
  if (found.measured) recording->config.dataset.camera = found.camera;
  return FocalLengthText(found, recording->photo_lens);
}

std::pair<RunConfig, std::vector<std::string>> Recognised(
    const fs::path& dataset, const std::optional<fs::path>& calibration, const std::string& camera,
    std::optional<double> fov, const std::optional<std::string>& sensor, const py::dict& sections) {
  CameraRequest request;
  request.calibration = calibration;
  request.camera = camera;
  request.view_deg = fov;
  if (sensor) request.sensor = SensorNamed("recognise", *sensor);
  RunConfig asked;
  SetOptions("recognise", "", sections, asked);
  request.depth_units_per_m = asked.dataset.depth_units_per_m;
  Recording recording = Reading(dataset, [&] { return Recognise(dataset, request); });
  SetOptions("recognise", "", sections, recording.config);
  if (recording.guessed_lens) {
    const py::gil_scoped_release release;
    recording.findings.push_back("camera  " + MeasureLens(dataset, &recording));
  }
  return {recording.config, recording.findings};
}

}  // namespace

void BindRecording(py::module_& module) {
  module.def(
      "recognise", &Recognised, py::arg("recording"), py::kw_only(), py::arg("calibration") = py::none(),
      py::arg("camera") = "", py::arg("fov") = py::none(), py::arg("sensor") = py::none(),
      py::arg("sections") = py::dict(),
      "Layout, sensor and camera of a recording (folder, video, bag, stream, camera:0), as `tutti run "
      "DATASET` finds them: a Config, and a sentence about each finding. The camera comes from "
      "`calibration` (a file of another program), `camera` (\"fx,fy,cx,cy[,k1,k2,p1,p2[,k3]]\" [px]), "
      "`fov` (horizontal [deg]), or what lies in the recording; else the focal length is measured on its "
      "first frames. `sections` of the configuration, {\"run\": {\"threads\": 1}}, go before what is "
      "found. Raises tutti.InputError "
      "for what is no recording, and for a calibration that can't be used.");
}

}  // namespace tutti::python
