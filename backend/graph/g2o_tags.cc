#include "backend/graph/g2o_tags.h"

#include <unordered_map>

namespace tutti::internal {
namespace {

using End = MeasurementEnd::What;
using What = PoseGraphMeasurement::What;

G2oTag PoseLine(const char* name, LineKind line, GraphKind kind, PoseForm form) {
  G2oTag tag;
  tag.name = name;
  tag.line = line;
  tag.kind = kind;
  tag.form = form;
  tag.coordinates = TangentCoordinates(kind);
  return tag;
}

G2oTag PoseLine(const char* name, LineKind line, GraphKind kind) {
  return PoseLine(name, line, kind, FormOf(kind));
}

G2oTag Measured(const char* name, GraphKind kind, What what, End from, End to, std::size_t sensors = 0) {
  G2oTag tag = PoseLine(name, LineKind::kMeasurement, kind);
  tag.what = what;
  tag.from = from;
  tag.to = to;
  tag.sensors = sensors;
  if (what == What::kPosition)
    tag.coordinates = kind == GraphKind::kSE2 ? std::vector<int>{0, 1} : std::vector<int>{0, 1, 2};
  if (what == What::kBearing) tag.coordinates = {0};
  return tag;
}

/// Several programs write the same under several names.
std::vector<G2oTag> AllTags() {
  constexpr GraphKind k2 = GraphKind::kSE2, k3 = GraphKind::kSE3, kS = GraphKind::kSim3;
  constexpr PoseForm kEuler = PoseForm::kEuler;
  std::vector<G2oTag> tags = {
      PoseLine("VERTEX_SE2", LineKind::kVertex, k2), PoseLine("EDGE_SE2", LineKind::kEdge, k2),
      PoseLine("VERTEX_SE3:QUAT", LineKind::kVertex, k3), PoseLine("EDGE_SE3:QUAT", LineKind::kEdge, k3),
      PoseLine("VERTEX_SIM3:QUAT", LineKind::kVertex, kS), PoseLine("EDGE_SIM3:QUAT", LineKind::kEdge, kS),
      // TORO, iSAM, and g2o for what TORO writes
      PoseLine("VERTEX2", LineKind::kVertex, k2), PoseLine("EDGE2", LineKind::kToroEdge, k2),
      PoseLine("VERTEX3", LineKind::kVertex, k3, kEuler), PoseLine("EDGE3", LineKind::kEdge, k3, kEuler),
      PoseLine("VERTEX_SE3:EULER", LineKind::kVertex, k3, kEuler),
      PoseLine("EDGE_SE3:EULER", LineKind::kEdge, k3, kEuler),
      // Vertigo and max-mixture: loops with a robust loss of their own
      PoseLine("EDGE_SE2_SWITCHABLE", LineKind::kSwitchable, k2),
      PoseLine("EDGE_SE3_SWITCHABLE", LineKind::kSwitchable, k3),
      PoseLine("EDGE_SE2_MAXMIX", LineKind::kMaxMixture, k2),
      PoseLine("EDGE_SE3_MAXMIX", LineKind::kMaxMixture, k3),
      PoseLine("EDGE_SE2_MIXTURE", LineKind::kMixture, k2),
      PoseLine("EDGE_SE3_MIXTURE", LineKind::kMixture, k3), PoseLine("VERTEX_SWITCH", LineKind::kSwitch, k2),
      PoseLine("EDGE_SWITCH_PRIOR", LineKind::kSwitch, k2),
      // Landmarks
      PoseLine("VERTEX_XY", LineKind::kLandmark, k2), PoseLine("VERTEX_TRACKXYZ", LineKind::kLandmark, k3),
      PoseLine("VERTEX_XYZ", LineKind::kLandmark, k3),
      Measured("EDGE_SE2_XY", k2, What::kPosition, End::kNode, End::kLandmark),
      Measured("EDGE_BEARING_SE2_XY", k2, What::kBearing, End::kNode, End::kLandmark),
      Measured("EDGE_POINTXY", k2, What::kPosition, End::kLandmark, End::kLandmark),
      Measured("EDGE_POINTXYZ", k3, What::kPosition, End::kLandmark, End::kLandmark),
      // Sensors
      PoseLine("PARAMS_SE2OFFSET", LineKind::kParameters, k2),
      PoseLine("PARAMS_SE3OFFSET", LineKind::kParameters, k3),
      Measured("EDGE_SE2_OFFSET", k2, What::kPose, End::kNode, End::kNode, 2),
      Measured("EDGE_SE3_OFFSET", k3, What::kPose, End::kNode, End::kNode, 2),
      // Priors
      Measured("EDGE_SE3_PRIOR", k3, What::kPose, End::kWorld, End::kNode, 1)};
  for (const char* name : {"EDGE_SE2_POINTXY_OFFSET", "EDGE_SE2_XY_OFFSET"})
    tags.push_back(Measured(name, k2, What::kPosition, End::kNode, End::kLandmark, 1));
  for (const char* name : {"EDGE_SE3_TRACKXYZ", "EDGE_SE3_POINTXYZ", "EDGE_SE3_XYZ"})
    tags.push_back(Measured(name, k3, What::kPosition, End::kNode, End::kLandmark, 1));
  for (const char* name : {"EDGE_PRIOR_SE2", "EDGE_SE2_PRIOR"})
    tags.push_back(Measured(name, k2, What::kPose, End::kWorld, End::kNode));
  for (const char* name : {"EDGE_PRIOR_SE2_XY", "EDGE_SE2_XY_PRIOR", "EDGE_SE2_PRIORXY"})
    tags.push_back(Measured(name, k2, What::kPosition, End::kWorld, End::kNode));
  for (const char* name : {"EDGE_PRIOR_XY", "EDGE_XY_PRIOR", "EDGE_XYPRIOR"})
    tags.push_back(Measured(name, k2, What::kPosition, End::kWorld, End::kLandmark));
  for (const char* name :
       {"EDGE_SE3_XYZPRIOR", "EDGE_SE3_XYZ_PRIOR", "EDGE_SE3_PRIORXYZ", "EDGE_SE3_PRIOR_XYZ"})
    tags.push_back(Measured(name, k3, What::kPosition, End::kWorld, End::kNode, 1));
  for (const char* name : {"EDGE_PRIOR_XYZ", "EDGE_XYZ_PRIOR", "EDGE_XYZPRIOR"})
    tags.push_back(Measured(name, k3, What::kPosition, End::kWorld, End::kLandmark));
  G2oTag flat = Measured("EDGE_SE3_PRIORXY", k3, What::kPosition, End::kWorld, End::kNode);
  flat.coordinates = {0, 1};
  tags.push_back(flat);
  return tags;
}

}  // namespace

const G2oTag* FindTag(const std::string& name) {
  static const std::unordered_map<std::string, G2oTag> by_name = [] {
    std::unordered_map<std::string, G2oTag> out;
    for (const G2oTag& tag : AllTags()) out.emplace(tag.name, tag);
    return out;
  }();
  const auto found = by_name.find(name);
  return found == by_name.end() ? nullptr : &found->second;
}

}  // namespace tutti::internal
