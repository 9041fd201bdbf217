#include "apps/slam/map_graph.h"

#include <algorithm>
#include <cmath>

#include "tutti/backend/graph_covariance.h"

namespace tutti {
namespace {

constexpr double kRadians = 0.017453292519943295;
constexpr int kRecentKeyframes = 20;  // ids apart: common landmarks are the odometry's own

Similarity Rescaled(const Similarity& s, double scale_a, double scale_b) {
  return Similarity(scale_a * s.scale / scale_b, s.rotation, scale_a * s.translation);
}

double ScaleOf(const std::map<int, Similarity>& poses, int id) {
  const auto found = poses.find(id);
  return found == poses.end() ? 1.0 : found->second.scale;
}

}  // namespace

MapGraph::MapGraph(const PoseGraphOptions& solver, const OnlineOptions& online, const SlamOptions& options,
                   Sensor sensor)
    : optimizer_(solver, online),
      options_(options),
      kind_(sensor == Sensor::kMono ? GraphKind::kSim3 : GraphKind::kSE3) {}

std::map<MapGraph::Edge, Similarity> MapGraph::OdometryEdges(const Odometry& odometry) const {
  const std::vector<int> ids = odometry.KeyframeIds();
  std::map<Edge, Similarity> edges;
  const auto add = [&](int a, int b) {
    const auto kept = kept_.find({a, b});
    edges[{a, b}] = kept != kept_.end()
                        ? kept->second
                        : Similarity(odometry.KeyframePose(a).Inverse() * odometry.KeyframePose(b));
  };
  const auto same_birth = [&](int a, int b) {
    const auto x = birth_piece_.find(a), y = birth_piece_.find(b);
    return x != birth_piece_.end() && y != birth_piece_.end() && x->second == y->second;
  };
  for (std::size_t i = 1; i < ids.size(); ++i) {
    if (same_birth(ids[i - 1], ids[i])) add(ids[i - 1], ids[i]);
  }
  // The strongest few of each keyframe: more would count the same landmarks again and again.
  std::map<int, std::vector<std::pair<int, int>>> older_of;  // newer id -> (-shared, older id)
  for (const auto& [pair, shared] : odometry.Covisibility(options_.covisibility_min_shared)) {
    // Keyframes that a loop brought together see common landmarks too; that is the loop's edge, not the
    // odometry's.
    const bool recent =
        kept_.count(pair) != 0 || kept_.empty() || pair.second - pair.first < kRecentKeyframes;
    if (recent && same_birth(pair.first, pair.second) && edges.count(pair) == 0) {
      older_of[pair.second].emplace_back(-shared, pair.first);
    }
  }
  for (auto& [newer, candidates] : older_of) {
    std::sort(candidates.begin(), candidates.end());
    const std::size_t count =
        std::min(candidates.size(), static_cast<std::size_t>(options_.covisibility_edges));
    for (std::size_t i = 0; i < count; ++i) add(candidates[i].second, newer);
  }
  return edges;
}

Matrix7d MapGraph::OdometryInformation(const Similarity& measurement, double length_floor) const {
  return MakeInformation(options_.odometry_sigma_fraction * measurement.translation.norm() + length_floor,
                         options_.odometry_sigma_deg * kRadians, options_.odometry_sigma_scale);
}

std::map<int, int> MapGraph::Merges(const Odometry& odometry, const std::vector<LoopEdge>& loops) const {
  std::map<int, int> root;  // piece -> smallest piece of its group
  const auto find = [&](int piece) {
    while (root.count(piece) != 0) piece = root[piece];
    return piece;
  };
  for (const LoopEdge& loop : loops) {
    const int a = find(odometry.KeyframePiece(loop.candidate)), b = find(odometry.KeyframePiece(loop.query));
    if (a != b) root[std::max(a, b)] = std::min(a, b);
  }
  std::map<int, int> merges;
  for (const auto& [piece, ignored] : root) merges[piece] = find(piece);
  return merges;
}

PoseGraph MapGraph::Build(const Odometry& odometry, const std::vector<LoopEdge>& loops) const {
  const std::vector<int> ids = odometry.KeyframeIds();
  // A joined piece starts where its first loop puts it.
  std::map<int, Similarity> S_root_piece;
  for (bool grown = true; grown;) {
    grown = false;
    for (const LoopEdge& loop : loops) {
      const int a = odometry.KeyframePiece(loop.candidate), b = odometry.KeyframePiece(loop.query);
      if (a == b) continue;
      const bool query_moves = a < b;
      const int from = query_moves ? a : b, moved = query_moves ? b : a;
      if (S_root_piece.count(moved) != 0) continue;
      const Similarity S_c(odometry.KeyframePose(loop.candidate)), S_q(odometry.KeyframePose(loop.query));
      const Similarity S_from_moved = query_moves ? S_c * loop.S_candidate_query * S_q.Inverse()
                                                  : S_q * loop.S_candidate_query.Inverse() * S_c.Inverse();
      const auto base = S_root_piece.find(from);
      S_root_piece[moved] = (base == S_root_piece.end() ? Similarity() : base->second) * S_from_moved;
      grown = true;
    }
  }
  PoseGraph graph(kind_);
  for (const int id : ids) {
    Similarity pose(odometry.KeyframePose(id));
    const auto moved = S_root_piece.find(odometry.KeyframePiece(id));
    if (moved != S_root_piece.end()) pose = moved->second * pose;
    if (kind_ == GraphKind::kSE3) pose.scale = 1;
    graph.AddNode(id, pose);
  }
  const std::map<Edge, Similarity> edges = OdometryEdges(odometry);
  double mean_length = 0;
  for (const auto& [pair, measurement] : edges) mean_length += measurement.translation.norm();
  mean_length /= std::max<double>(1, static_cast<double>(edges.size()));
  for (const auto& [pair, measurement] : edges) {
    graph.AddOdometry(pair.first, pair.second, measurement,
                      OdometryInformation(measurement, 0.002 * mean_length + 1e-6));
  }
  for (const LoopEdge& loop : loops) {
    graph.AddLoop(loop.candidate, loop.query, loop.S_candidate_query, loop.information);
  }
  return graph;
}

MapGraph::Correction MapGraph::Optimize(const Odometry& odometry, const std::vector<LoopEdge>& loops) {
  Correction correction;
  PoseGraph graph = Build(odometry, loops);
  const OnlineReport report = optimizer_.Optimize(graph);
  correction.success = report.success;
  correction.reason = report.reason;
  if (!report.success) return correction;
  correction.S_world_keyframe = graph.Poses();
  correction.merges = Merges(odometry, loops);
  for (std::size_t i = 0; i < graph.edges().size(); ++i) {
    if (graph.edges()[i].kind == EdgeKind::kLoop) correction.weights.push_back(report.edges[i].weight);
  }
  for (const LoopEdge& loop : loops) {
    const Similarity& c = correction.S_world_keyframe.at(loop.candidate);
    const Similarity& q = correction.S_world_keyframe.at(loop.query);
    const Similarity E = loop.S_candidate_query * q.Inverse() * c;  // in the candidate's units, as depth is
    correction.residuals.push_back(Measure(E, loop.depth));
  }
  return correction;
}

void MapGraph::MeasureAgain(const Odometry& odometry, std::vector<LoopEdge>& accepted) {
  kept_.clear();
  for (LoopEdge& loop : accepted) {
    const Similarity in_map(odometry.KeyframePose(loop.candidate).Inverse() *
                            odometry.KeyframePose(loop.query));
    const Disagreement d = Measure(loop.S_candidate_query * in_map.Inverse(), loop.depth);
    if (!Contradicts(d, options_)) loop.S_candidate_query = in_map;
  }
}

std::vector<std::optional<double>> MapGraph::Distances(const Odometry& odometry,
                                                       const std::vector<LoopEdge>& accepted,
                                                       const std::vector<LoopEdge>& entering) const {
  const GraphCovariance known(Build(odometry, accepted));
  std::vector<std::optional<double>> out;
  for (const LoopEdge& loop : entering) {
    out.emplace_back();
    if (!known.Connected(loop.candidate, loop.query)) continue;
    const PoseGraphEdge edge{loop.candidate, loop.query, loop.S_candidate_query, loop.information,
                             EdgeKind::kLoop};
    out.back() = std::sqrt(known.SquaredDistance(edge));
  }
  return out;
}

void MapGraph::Keep(const Odometry& odometry, const Correction& correction, std::vector<LoopEdge>& accepted,
                    std::vector<LoopEdge>& waiting) {
  const std::map<int, Similarity>& poses = correction.S_world_keyframe;
  kept_ = OdometryEdges(odometry);
  for (auto& [pair, measurement] : kept_) {
    measurement = Rescaled(measurement, ScaleOf(poses, pair.first), ScaleOf(poses, pair.second));
  }
  for (std::vector<LoopEdge>* loops : {&accepted, &waiting}) {
    for (LoopEdge& loop : *loops) {
      const double scale_c = ScaleOf(poses, loop.candidate), scale_q = ScaleOf(poses, loop.query);
      loop.S_candidate_query = Rescaled(loop.S_candidate_query, scale_c, scale_q);
      loop.depth *= scale_c;
      // The residual lives in the query's frame, and so does the information.
      loop.information.topLeftCorner<3, 7>() /= scale_q;
      loop.information.topLeftCorner<7, 3>() /= scale_q;
    }
  }
}

}  // namespace tutti
