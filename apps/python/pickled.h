// Values that Python can pickle, and so copy and send to other processes.
#pragma once

#include <string>

#include "apps/python/bindings.h"
#include "apps/slam/map_state.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/version.h"

namespace tutti {

template <class Archive>
void State(Archive& archive, PosePrior& prior) {
  archive(prior.position_m, prior.frame, prior.sigma_m, prior.drift);
}

/// Without the step, which Python does not see.
template <class Archive>
void State(Archive& archive, TrackResult& result) {
  archive(result.state, result.reason, result.T_world_camera, result.features, result.inliers,
          result.by_grey_values, result.keyframe);
}

namespace python {

/// For py::class_::def: the bytes of a value that has a State (core/state_archive.h). Only the version of
/// tutti that wrote them reads them: raises ValueError for those of another one, and for what is damaged.
template <class T>
auto Pickled() {
  return py::pickle(
      [](const T& value) { return py::make_tuple(kVersion, py::bytes(StateOf(value))); },
      [](const py::tuple& state) {
        if (state.size() != 2 || !py::isinstance<py::str>(state[0]) || !py::isinstance<py::bytes>(state[1]))
          throw py::value_error("this pickle is damaged");
        const auto version = state[0].cast<std::string>();
        if (version != kVersion)
          throw py::value_error("this pickle is of tutti " + version + ", and can't be read by tutti " +
                                kVersion);
        const auto bytes = state[1].cast<std::string>();
        internal::SharedObjectsIn shared;
        internal::StateReader in(bytes, "this pickle", &shared);
        T value;
        in(value);
        in.ExpectEnd();
        return value;
      });
}

}  // namespace python
}  // namespace tutti
