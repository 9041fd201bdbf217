// The arguments of LoopDetector.detect and locate.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/python/bindings.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::python {

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

/// Raises TypeError or ValueError that names the argument.
QueryOf MakeQuery(std::int64_t id, const QueryArguments& arguments);

}  // namespace tutti::python
