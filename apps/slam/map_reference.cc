#include "apps/slam/map_reference.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/numbers.h"
#include "tutti/backend/keyframe_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace {

// How much farther away `now` sees than `before` saw, the median over landmarks of both; 1 without any.
double Growth(const KeyframeView& before, const KeyframeView& now) {
  std::vector<double> ratios;
  for (std::size_t f = 0; f < before.landmarks.size() && f < now.landmarks.size(); ++f) {
    if (before.landmarks[f] < 0 || now.landmarks[f] < 0) continue;
    const double was = before.points[f].z(), is = now.points[f].z();
    if (was > 0 && is > 0) ratios.push_back(is / was);
  }
  return ratios.empty() ? 1 : internal::Median(std::move(ratios));
}

// What an accelerometer says of up near a keyframe.
struct Tilt {
  int keyframe = -1;
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // in the keyframe's camera
  Eigen::Vector2d off = Eigen::Vector2d::Zero();  // in the upright world: x and y of up [rad]
};

std::vector<Tilt> TiltsOf(const Map& map, const ImuReport& imu, const Similarity& turn) {
  std::map<std::int64_t, int> keyframe_of_frame;
  for (const int id : map.KeyframeIds()) keyframe_of_frame[map.keyframe(id).frame_index] = id;
  std::vector<Tilt> tilts;
  if (keyframe_of_frame.empty()) return tilts;
  for (const ImuTilt& tilt : imu.tilts) {
    auto at = keyframe_of_frame.lower_bound(tilt.frame);
    if (at == keyframe_of_frame.end()) --at;
    const Eigen::Quaterniond R_world_camera = map.keyframe(at->second).T_world_camera.rotation;
    tilts.push_back({at->second, R_world_camera.conjugate() * tilt.up, (turn.rotation * tilt.up).head<2>()});
  }
  return tilts;
}

// Standard deviation of an axis of one of them, by those that follow one another [rad].
double Scatter(const std::vector<Tilt>& tilts) {
  constexpr double kMedianOfRayleigh = 1.177, kRoot2 = 1.414;
  std::vector<double> steps;
  for (std::size_t i = 1; i < tilts.size(); ++i) steps.push_back((tilts[i].off - tilts[i - 1].off).norm());
  return steps.empty() ? 0 : internal::Median(std::move(steps)) / (kMedianOfRayleigh * kRoot2);
}

// True if the mean of some that follow one another is off by more than a degree, and than they scatter.
bool IsBent(const std::vector<Tilt>& tilts, double scatter) {
  constexpr std::size_t kBlock = 16;
  constexpr double kBent = internal::kRadians, kSigmas = 6;
  const double most = std::max(kBent, kSigmas * scatter / std::sqrt(static_cast<double>(kBlock)));
  for (std::size_t first = 0; first + kBlock <= tilts.size(); first += kBlock / 2) {
    std::vector<double> x, y;
    for (std::size_t i = first; i < first + kBlock; ++i) {
      x.push_back(tilts[i].off.x());
      y.push_back(tilts[i].off.y());
    }
    if (std::hypot(internal::Median(x), internal::Median(y)) > most) return true;
  }
  return false;
}

// A node more stands for the world, upright and where the first keyframe is. Of an edge to it, only what
// turns about its x and y axis has weight; the first keyframe's holds the graph where it is.
void SolveWithTilts(const std::vector<Tilt>& tilts, double scatter, const Similarity& turn,
                    PoseGraph* graph) {
  constexpr double kCorrelated = 3;  // what one of them says, its neighbours say as well
  constexpr double kLoose = 1e-6, kHeld = 1e8;
  const PoseGraphNode first = graph->nodes().front();
  const NodeId world = graph->nodes().back().id + 1;
  const Similarity S_world(1, turn.rotation.conjugate(), first.pose.translation);
  graph->AddNode(world, S_world, true);
  graph->SetFixed(first.id, false);
  const auto add = [&](NodeId id, const Eigen::Quaterniond& R_camera_world, double tilt, double other) {
    PoseGraphEdge edge;
    edge.from = id;
    edge.to = world;
    edge.measurement = graph->Node(id).pose.Inverse() * S_world;
    edge.measurement.rotation = R_camera_world;
    Vector7d weights = Vector7d::Constant(other);
    weights.segment<2>(3).setConstant(tilt);
    edge.information = weights.asDiagonal();
    graph->AddEdge(edge);
  };
  const auto rotation_to = [&](NodeId id) {
    return graph->Node(id).pose.rotation.conjugate() * S_world.rotation;
  };
  add(first.id, rotation_to(first.id), kLoose, kHeld);
  const double sigma = std::max(internal::kRadians, kCorrelated * scatter);
  for (const Tilt& tilt : tilts) {
    const Eigen::Quaterniond R = rotation_to(tilt.keyframe);
    const auto tilted = Eigen::Quaterniond::FromTwoVectors(R * Eigen::Vector3d::UnitZ(), tilt.up);
    add(tilt.keyframe, tilted * R, 1 / (sigma * sigma), kLoose);
  }
  PoseGraph solved = *graph;
  PoseGraphOptions options = KeyframeGraphOptions().solver;
  options.robust = RobustLoss::kNone;
  if (PoseGraphOptimizer(options).Optimize(solved).success) *graph = std::move(solved);
}

}  // namespace

std::map<int, Similarity> InFrameOf(const Map& first, int first_keyframe, const Map& merged) {
  std::map<int, Similarity> S_first_piece;
  for (const int id : first.KeyframeIds()) {
    const KeyframeView now = ViewOf(merged, first_keyframe + id);
    if (S_first_piece.count(now.map_piece) != 0) continue;
    const KeyframeView before = ViewOf(first, id);
    Similarity S_camera_now = Similarity(now.T_world_camera).Inverse();
    if (first.rig().sensor == Sensor::kMono) {
      const double scale = 1 / Growth(before, now);
      S_camera_now.scale = scale;
      S_camera_now.translation *= scale;
    }
    S_first_piece[now.map_piece] = Similarity(before.T_world_camera) * S_camera_now;
  }
  std::map<int, Similarity> S_first_keyframe;
  for (const int id : merged.KeyframeIds()) {
    const auto moved = S_first_piece.find(merged.keyframe(id).piece);
    if (moved != S_first_piece.end())
      S_first_keyframe[id] = moved->second * Similarity(merged.keyframe(id).T_world_camera);
  }
  return S_first_keyframe;
}

std::optional<Similarity> UprightTurn(const std::optional<ImuReport>& imu) {
  if (!imu || !imu->up) return std::nullopt;
  return Similarity(imu->KnowsMetres() ? imu->metres : 1,
                    Eigen::Quaterniond::FromTwoVectors(*imu->up, Eigen::Vector3d::UnitZ()),
                    Eigen::Vector3d::Zero());
}

std::map<int, Similarity> Upright(const Map& map, const ImuReport& imu, const Similarity& turn,
                                  PoseGraph graph) {
  const std::vector<Tilt> tilts = TiltsOf(map, imu, turn);
  const double scatter = Scatter(tilts);
  if (IsBent(tilts, scatter)) SolveWithTilts(tilts, scatter, turn, &graph);
  std::map<int, Similarity> upright;
  for (const int id : map.KeyframeIds()) upright[id] = turn * graph.Node(id).pose;
  return upright;
}

}  // namespace tutti
