// What the first word of a g2o file's line stands for. Private to the back end.
#pragma once

#include <string>
#include <vector>

#include "backend/graph/g2o_line.h"
#include "tutti/backend/pose_graph.h"

namespace tutti::internal {

enum class LineKind {
  kVertex,
  kEdge,
  kToroEdge,    ///< information xx xy yy tt xt yt instead of the upper triangle
  kSwitchable,  ///< an edge with the id of its switch behind those of its ends
  kMaxMixture,  ///< an edge with the weight of the null hypothesis behind the ids
  kMixture,     ///< several edges, one of which is meant
  kSwitch,      ///< a switch, or its prior
  kParameters,  ///< the pose of a sensor
  kLandmark,
  kMeasurement,
};

struct G2oTag {
  std::string name;
  LineKind line = LineKind::kVertex;
  GraphKind kind = GraphKind::kSE2;
  PoseForm form = PoseForm::kPlanar;
  /// kMeasurement: what is measured between what (kEdge: two nodes), ...
  PoseGraphMeasurement::What what = PoseGraphMeasurement::What::kPosition;
  MeasurementEnd::What from = MeasurementEnd::What::kWorld, to = MeasurementEnd::What::kNode;
  std::size_t sensors = 0;       ///< ... and how many ids of parameters may stand before the numbers
  std::vector<int> coordinates;  ///< of the information, and of a position
};

/// nullptr for a tag that is not known.
const G2oTag* FindTag(const std::string& name);

}  // namespace tutti::internal
