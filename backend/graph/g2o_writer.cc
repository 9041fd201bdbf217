#include <cstdio>
#include <string>

#include "backend/graph/edge_error.h"
#include "core/replaced_file.h"
#include "tutti/backend/g2o_io.h"

namespace tutti {
namespace {

void Append(std::string& line, double value) {
  char text[32];
  std::snprintf(text, sizeof text, " %.17g", value);
  line += text;
}

void AppendPose(std::string& line, const Similarity& pose, GraphKind kind) {
  Append(line, pose.translation.x());
  Append(line, pose.translation.y());
  if (kind == GraphKind::kSE2) {
    Append(line, internal::WrapAngle(internal::Heading(pose.rotation)));
    return;
  }
  Append(line, pose.translation.z());
  for (double value : {pose.rotation.x(), pose.rotation.y(), pose.rotation.z(), pose.rotation.w()})
    Append(line, value);
  if (kind == GraphKind::kSim3) Append(line, pose.scale);
}

}  // namespace

void WriteG2o(const std::filesystem::path& file, const PoseGraph& graph) {
  std::string text;
  const GraphKind kind = graph.kind();
  const std::string name = kind == GraphKind::kSE2   ? "SE2"
                           : kind == GraphKind::kSE3 ? "SE3:QUAT"
                                                     : "SIM3:QUAT";
  std::string line;
  for (const std::string& parameters : graph.parameter_lines) text += parameters + '\n';
  for (const PoseGraphNode& node : graph.nodes()) {
    if (!node.has_estimate) continue;
    line = "VERTEX_" + name + " " + graph.NameOf(node.id);
    AppendPose(line, node.pose, kind);
    text += line + '\n';
  }
  for (const PoseGraphLandmark& landmark : graph.landmarks()) {
    if (!landmark.has_estimate) continue;
    line = (kind == GraphKind::kSE2 ? "VERTEX_XY " : "VERTEX_TRACKXYZ ") + graph.NameOf(landmark.id);
    for (int k = 0; k < (kind == GraphKind::kSE2 ? 2 : 3); ++k) Append(line, landmark.position(k));
    text += line + '\n';
  }
  for (const PoseGraphNode& node : graph.nodes()) {
    if (node.fixed) text += "FIX " + graph.NameOf(node.id) + '\n';
  }
  for (const PoseGraphLandmark& landmark : graph.landmarks()) {
    if (landmark.fixed) text += "FIX " + graph.NameOf(landmark.id) + '\n';
  }
  const std::vector<int> used = TangentCoordinates(kind);
  for (const PoseGraphEdge& edge : graph.edges()) {
    line = "EDGE_" + name + " " + graph.NameOf(edge.from) + " " + graph.NameOf(edge.to);
    AppendPose(line, edge.measurement, kind);
    for (std::size_t r = 0; r < used.size(); ++r) {
      for (std::size_t c = r; c < used.size(); ++c) Append(line, edge.information(used[r], used[c]));
    }
    text += line + '\n';
  }
  for (const PoseGraphMeasurement& measurement : graph.measurements()) text += measurement.line + '\n';
  internal::WriteFile(file, text);
}

}  // namespace tutti
