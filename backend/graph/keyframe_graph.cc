#include "tutti/backend/keyframe_graph.h"

#include <algorithm>
#include <cmath>

#include "tutti/core/error.h"

namespace tutti {
namespace {

/// Groups of map pieces that loops tie together: piece -> smallest piece of its group.
int GroupOf(const std::map<int, int>& group, int piece) {
  auto it = group.find(piece);
  while (it != group.end() && it->second != piece) {
    piece = it->second;
    it = group.find(piece);
  }
  return piece;
}

}  // namespace

KeyframeGraphOptions::KeyframeGraphOptions() {
  solver.init = GraphInit::kFile;
  solver.objective = GraphObjective::kChi2Log;
  solver.robust = kDefaultRobustLoss;
  solver.max_iterations = 50;
  solver.function_tolerance = 1e-6;
}

std::string KeyframeGraphOptions::Validate() const {
  if (kind == GraphKind::kSE2) return "keyframe graph: kind must be kSE3 or kSim3";
  if (!(sigma_translation_ratio >= 0) || !(sigma_translation_floor > 0)) {
    return "keyframe graph: sigma_translation_ratio must be >= 0 and sigma_translation_floor > 0";
  }
  if (!(sigma_rotation_rad > 0)) return "keyframe graph: sigma_rotation_rad must be positive";
  if (!(sigma_log_scale > 0)) return "keyframe graph: sigma_log_scale must be positive";
  return solver.Validate();
}

KeyframeGraph::KeyframeGraph(const KeyframeGraphOptions& options) : options_(options), graph_(options.kind) {
  const std::string wrong = options.Validate();
  if (!wrong.empty()) throw InputError(wrong);
}

Matrix7d KeyframeGraph::OdometryInformation(const Similarity& S_from_to) const {
  const double sigma = std::max(options_.sigma_translation_floor,
                                options_.sigma_translation_ratio * S_from_to.translation.norm());
  return MakeInformation(sigma, options_.sigma_rotation_rad, options_.sigma_log_scale);
}

void KeyframeGraph::AddKeyframe(int id, const Similarity& S_world_keyframe, int map_piece) {
  const bool first = graph_.nodes().empty();
  graph_.AddNode(id, S_world_keyframe, first);
  piece_[id] = map_piece;
  if (!first && piece_.at(last_id_) == map_piece) {
    const Similarity S_from_to = graph_.Node(last_id_).pose.Inverse() * S_world_keyframe;
    graph_.AddOdometry(last_id_, id, S_from_to, OdometryInformation(S_from_to));
  }
  last_id_ = id;
}

void KeyframeGraph::AddCovisibility(int older, int newer, double confidence) {
  const Similarity S_from_to = graph_.Node(older).pose.Inverse() * graph_.Node(newer).pose;
  graph_.AddOdometry(older, newer, S_from_to, confidence * OdometryInformation(S_from_to));
}

void KeyframeGraph::AddOdometry(int from, int to, const Similarity& S_from_to, const Matrix7d& information) {
  graph_.AddOdometry(from, to, S_from_to, information);
}

void KeyframeGraph::AddLoop(int from, int to, const Similarity& S_from_to, const Matrix6d& information,
                            double sigma_log_scale) {
  graph_.AddLoop(from, to, S_from_to,
                 MakeInformation(information, 1.0 / (sigma_log_scale * sigma_log_scale)));
}

KeyframeCorrection KeyframeGraph::Optimize() const {
  KeyframeCorrection out;
  PoseGraph graph = graph_;
  // A loop between two map pieces is all that is known of their relative place: put the newer piece there
  // first, for it may start anywhere.
  std::map<int, int> group;
  for (const auto& [id, piece] : piece_) group[piece] = piece;
  for (const PoseGraphEdge& edge : graph_.edges()) {
    if (edge.kind != EdgeKind::kLoop) continue;
    const int a = GroupOf(group, piece_.at(edge.from)), b = GroupOf(group, piece_.at(edge.to));
    if (a == b) continue;
    const bool move_to = a < b;  // the smaller piece stays
    const Similarity target = move_to ? graph.Node(edge.from).pose * edge.measurement
                                      : graph.Node(edge.to).pose * edge.measurement.Inverse();
    const int moved_id = move_to ? edge.to : edge.from;
    Similarity shift = target * graph.Node(moved_id).pose.Inverse();
    if (options_.kind == GraphKind::kSE3) shift.scale = 1.0;
    const int moved = std::max(a, b);
    for (const auto& [id, piece] : piece_) {
      if (GroupOf(group, piece) == moved) graph.SetPose(id, shift * graph.Node(id).pose);
    }
    group[moved] = std::min(a, b);
  }
  for (const auto& [piece, unused] : group) {
    (void)unused;
    const int joined = GroupOf(group, piece);
    if (joined != piece) out.merges[piece] = joined;
  }

  std::vector<double> before;
  for (const PoseGraphEdge& edge : graph.edges())
    before.push_back(EdgeChi2(graph, edge, options_.solver.objective));
  out.report = PoseGraphOptimizer(options_.solver).Optimize(graph);
  out.success = out.report.success;
  out.reason = out.report.reason;
  out.S_world_keyframe = graph.Poses();
  for (std::size_t e = 0; e < graph.edges().size() && e < out.report.edges.size(); ++e) {
    const PoseGraphEdge& edge = graph.edges()[e];
    if (edge.kind != EdgeKind::kLoop) continue;
    const EdgeOutcome& outcome = out.report.edges[e];
    out.loops.push_back({edge.from, edge.to, before[e], outcome.chi2, outcome.weight, outcome.down_weighted});
  }
  return out;
}

}  // namespace tutti
