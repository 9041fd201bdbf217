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
  for (const PoseGraphNode& node : graph.nodes()) {
    if (!node.has_estimate) continue;
    line = "VERTEX_" + name + " " + std::to_string(node.id);
    AppendPose(line, node.pose, kind);
    text += line + '\n';
  }
  for (const PoseGraphNode& node : graph.nodes()) {
    if (node.fixed) text += "FIX " + std::to_string(node.id) + '\n';
  }
  const std::vector<int> used = TangentCoordinates(kind);
  for (const PoseGraphEdge& edge : graph.edges()) {
    line = "EDGE_" + name + " " + std::to_string(edge.from) + " " + std::to_string(edge.to);
    AppendPose(line, edge.measurement, kind);
    for (std::size_t r = 0; r < used.size(); ++r) {
      for (std::size_t c = r; c < used.size(); ++c) Append(line, edge.information(used[r], used[c]));
    }
    text += line + '\n';
  }
  internal::WriteFile(file, text);
}

}  // namespace tutti
