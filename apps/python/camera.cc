// tutti.Camera: a pinhole camera.
#include "tutti/core/camera.h"

#include <pybind11/stl.h>

#include <map>
#include <string>

#include "apps/python/arrays.h"
#include "apps/python/bindings.h"
#include "apps/python/pickled.h"
#include "tutti/core/error.h"

namespace tutti::python {
namespace {

// Name and sentence of each keyword. The section of the YAML files has more: what the rig is told.
std::map<std::string, std::string> CameraKeywords() {
  std::map<std::string, std::string> keywords;
  const PinholeCamera camera;
  ForEachOption(camera, [&](const OptionText& text, const auto& /*field*/) {
    keywords[text.name] = text.sentence + (*text.unit == '\0' ? "" : " [" + std::string(text.unit) + "]");
  });
  return keywords;
}

std::string DescribeCamera() {
  std::string text = std::string(doc::PinholeCamera) + "\n\nKeywords:\n";
  for (const auto& [name, sentence] : CameraKeywords())
    text.append(name).append(": ").append(sentence).append("\n");
  return text;
}

PinholeCamera CameraOf(const py::kwargs& keywords) {
  for (const char* of_the_rig : {"baseline_m", "readout_s", "depth_delay_s", "T_camera_imu", "right"}) {
    if (keywords.contains(of_the_rig))
      throw py::type_error("Camera: " + std::string(of_the_rig) +
                           " is told to the Rig, or to Dataset(camera={...})");
  }
  RunConfig config;
  SetOptions("Camera", "camera", keywords, config);
  if (!config.dataset.camera) throw InputError("Camera: needs width, height, fx, fy, cx, cy");
  return *config.dataset.camera;
}

}  // namespace

void BindCamera(py::module_& module) {
  py::class_<PinholeCamera>(module, "Camera", DescribeCamera().c_str())
      .def(py::init(&CameraOf))
      .def(Pickled<PinholeCamera>())
      .def_readonly("width", &PinholeCamera::width, "image width [px]")
      .def_readonly("height", &PinholeCamera::height, "image height [px]")
      .def_readonly("fx", &PinholeCamera::fx, "focal length [px]")
      .def_readonly("fy", &PinholeCamera::fy, "focal length [px]")
      .def_readonly("cx", &PinholeCamera::cx, "principal point [px]")
      .def_readonly("cy", &PinholeCamera::cy, "principal point [px]")
      .def_property_readonly(
          "distortion", [](const PinholeCamera& camera) { return WordOf(camera.distortion); },
          "lens model: none, radtan or equidistant")
      .def_readonly("coefficients", &PinholeCamera::coefficients, doc::DistortionCoefficients)
      .def_property_readonly(
          "matrix", [](const PinholeCamera& camera) { return ArrayOf(Eigen::MatrixXd(camera.Matrix())); },
          doc::PinholeCamera_Matrix)
      .def("__repr__", [](const PinholeCamera& camera) {
        return py::str("Camera(width={}, height={}, fx={}, fy={}, cx={}, cy={}, distortion='{}')")
            .format(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy,
                    WordOf(camera.distortion));
      });
}

}  // namespace tutti::python
