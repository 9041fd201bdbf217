// Where landmarks and priors are when a solution starts.
#include <algorithm>
#include <cmath>
#include <optional>

#include "backend/solver/graph_initialization.h"
#include "core/umeyama.h"

namespace tutti::internal {
namespace {

using End = MeasurementEnd::What;
using What = PoseGraphMeasurement::What;

/// A part of the graph, and what its priors want.
struct Wanted {
  std::vector<Eigen::Vector3d> is, wanted;  // positions of sensors
  std::optional<Similarity> motion;         // of a prior that knows the rotation
};

bool KnowsRotation(const PoseGraphMeasurement& m, GraphKind kind) {
  return m.what == What::kPose &&
         (kind == GraphKind::kSE2 ? m.information(5, 5) > 0
                                  : m.information.diagonal().segment<3>(3).minCoeff() > 0);
}

/// Rotation and translation that bring the positions to where they are wanted; a translation where they do
/// not tell the rotation.
Similarity MotionOf(const Wanted& part, GraphKind kind) {
  Similarity motion(1.0, Eigen::Quaterniond::Identity(), part.wanted.front() - part.is.front());
  if (kind != GraphKind::kSE2) return Umeyama(part.wanted, part.is, false).value_or(motion);
  double along = 0, across = 0;
  for (std::size_t k = 1; k < part.is.size(); ++k) {
    const Eigen::Vector3d is = part.is[k] - part.is[0], wanted = part.wanted[k] - part.wanted[0];
    along += is.dot(wanted);
    across += is.cross(wanted).z();
  }
  if (along == 0 && across == 0) return motion;
  motion.rotation = ExpSO3({0, 0, std::atan2(across, along)});
  motion.translation = part.wanted.front() - motion.rotation * part.is.front();
  return motion;
}

}  // namespace

void AppendLandmarks(const PoseGraph& graph, bool as_given, std::vector<Similarity>& poses) {
  const std::vector<PoseGraphLandmark>& landmarks = graph.landmarks();
  std::vector<Eigen::Vector3d> sums(landmarks.size(), Eigen::Vector3d::Zero());
  std::vector<int> counts(landmarks.size(), 0);
  const auto add = [&](std::size_t k, const Eigen::Vector3d& position) {
    sums[k] += position;
    ++counts[k];
  };
  for (const PoseGraphMeasurement& m : graph.measurements()) {
    if (m.what != What::kPosition || m.to.what != End::kLandmark) continue;
    const std::size_t k = graph.IndexOfLandmark(m.to.id);
    if (m.from.what == End::kWorld) add(k, m.value.translation);
    if (m.from.what == End::kNode)
      add(k, poses[graph.IndexOf(m.from.id)] * m.from.sensor * m.value.translation);
  }
  std::vector<bool> keeps(landmarks.size());
  for (std::size_t k = 0; k < landmarks.size(); ++k) {
    keeps[k] = landmarks[k].has_estimate && (as_given || landmarks[k].fixed);
    if (keeps[k] || (counts[k] == 0 && landmarks[k].has_estimate)) {
      sums[k] = landmarks[k].position;
      counts[k] = 1;
    }
  }
  // Those that only other landmarks see.
  for (bool placed = true; placed;) {
    placed = false;
    for (const PoseGraphMeasurement& m : graph.measurements()) {
      if (m.from.what != End::kLandmark) continue;
      const std::size_t a = graph.IndexOfLandmark(m.from.id), b = graph.IndexOfLandmark(m.to.id);
      if ((counts[a] == 0) == (counts[b] == 0)) continue;
      const std::size_t from = counts[a] > 0 ? a : b, to = counts[a] > 0 ? b : a;
      add(to, sums[from] / counts[from] + (from == a ? 1 : -1) * m.value.translation);
      placed = true;
    }
  }
  for (std::size_t k = 0; k < landmarks.size(); ++k)
    poses.emplace_back(1.0, Eigen::Quaterniond::Identity(), sums[k] / std::max(1, counts[k]));
}

void AlignToPriors(const PoseGraph& graph, const GraphStructure& structure, std::vector<Similarity>& poses) {
  std::vector<Wanted> parts(structure.components.size());
  for (const PoseGraphMeasurement& m : graph.measurements()) {
    if (m.from.what != End::kWorld || m.to.what != End::kNode || m.information.isZero(0)) continue;
    const std::size_t node = graph.IndexOf(m.to.id);
    Wanted& part = parts[structure.component_of[node]];
    const Similarity sensor = poses[node] * m.to.sensor;
    part.is.push_back(sensor.translation);
    part.wanted.push_back(m.value.translation);
    if (!part.motion && KnowsRotation(m, graph.kind())) part.motion = m.value * sensor.Inverse();
  }
  for (std::size_t c = 0; c < parts.size(); ++c) {
    Wanted& part = parts[c];
    const std::size_t anchor = structure.anchor[c];
    if (part.is.empty() || graph.nodes()[anchor].fixed) continue;
    if (!part.motion) part.motion = MotionOf(part, graph.kind());
    for (std::size_t k = 0; k < structure.component_of.size(); ++k) {
      if (structure.component_of[k] == c) poses[k] = *part.motion * poses[k];
    }
  }
}

}  // namespace tutti::internal
