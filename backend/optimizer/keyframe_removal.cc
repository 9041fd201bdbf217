// KeyframeGraph: keyframes leave the map, and their edges lead to what stands for them.
#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "core/dense_solvers.h"
#include "tutti/backend/keyframe_graph.h"

namespace tutti {
namespace {

using Ends = std::pair<int, int>;  // older, newer

// An edge as seen from one of its ends.
struct Way {
  Similarity S_from_to;
  double length = 0;  // in units of `from`
};

template <typename Edge>
Way From(int end, const Edge& edge) {
  if (edge.older == end) return {edge.S_older_newer, edge.Way()};
  const Similarity S_newer_older = edge.S_older_newer.Inverse();
  return {S_newer_older, S_newer_older.scale * edge.Way()};
}

// The edge between `a` and `b` that leads over `over`.
template <typename Edge>
Edge Joined(int a, const Edge& first, int over, const Edge& second, int b) {
  const Way one = From(a, first), two = From(over, second);
  const Similarity S_a_b = one.S_from_to * two.S_from_to;
  const double length = one.length + one.S_from_to.scale * two.length;
  Edge edge;
  edge.older = std::min(a, b);
  edge.newer = std::max(a, b);
  edge.S_older_newer = a < b ? S_a_b : S_a_b.Inverse();
  edge.steps = first.steps + second.steps;
  edge.way = a < b ? length : edge.S_older_newer.scale * length;
  return edge;
}

// (information^-1 + covariance)^-1, for any information.
Matrix7d LessSure(const Matrix7d& information, const Matrix7d& covariance) {
  const Matrix7d sum = information + internal::Inverse(covariance);
  const Matrix7d less = information - information * internal::SolveLdlt(sum, information);
  return 0.5 * (less + less.transpose());
}

}  // namespace

// The edge is as measured; two keyframes without one are where the map has them.
KeyframeGraph::Edge KeyframeGraph::Between(int older, int newer) const {
  if (const Edge* edge = FindEdge(edges_, older, newer)) return *edge;
  return {older, newer, Similarity(At(older).T_world_keyframe.Inverse() * At(newer).T_world_keyframe)};
}

void KeyframeGraph::Remove(const std::map<int, int>& into) {
  std::map<Ends, Edge> edges;
  std::map<int, std::set<int>> neighbours;
  std::set<Ends> carried;
  for (const Edge& edge : carried_) carried.emplace(edge.older, edge.newer);
  for (const Edge& edge : edges_) {
    edges[{edge.older, edge.newer}] = edge;
    neighbours[edge.older].insert(edge.newer);
    neighbours[edge.newer].insert(edge.older);
  }
  std::set<Ends> joined;
  for (auto removal = into.rbegin(); removal != into.rend(); ++removal) {
    const auto [id, other] = *removal;
    const auto found = edges.find({other, id});
    const Edge link = found != edges.end() ? found->second : Between(other, id);
    for (const int neighbour : neighbours[id]) {
      const auto old = edges.find(std::minmax(id, neighbour));
      neighbours[neighbour].erase(id);
      if (neighbour != other) {
        const Edge edge = Joined(other, link, id, old->second, neighbour);
        const Ends ends(edge.older, edge.newer);
        const auto [there, is_new] = edges.emplace(ends, edge);
        if (is_new || edge.steps < there->second.steps) {
          there->second = edge;
          joined.insert(ends);
        }
        neighbours[other].insert(neighbour);
        neighbours[neighbour].insert(other);
        carried.insert(ends);
      }
      edges.erase(old);
    }
    neighbours.erase(id);
  }
  const auto left = [&](int id) { return into.count(id) != 0; };
  std::vector<Edge> kept;
  edges_.clear();
  carried_.clear();
  for (const auto& [ends, edge] : edges) {
    edges_.push_back(edge);
    if (carried.count(ends) != 0) carried_.push_back(edge);
    // Where all is measured from the map, so is the sum.
    if (!kept_.empty() && (joined.count(ends) != 0 || FindEdge(kept_, edge.older, edge.newer) != nullptr))
      kept.push_back(edge);
  }
  kept_ = std::move(kept);
  keyframes_.erase(std::remove_if(keyframes_.begin(), keyframes_.end(),
                                  [&](const MapKeyframe& keyframe) { return left(keyframe.id); }),
                   keyframes_.end());
}

// Adjoint of the tangent (translation, rotation, log scale): S Exp(d) = Exp(Adjoint(S) d) S.
Matrix7d KeyframeGraph::Adjoint(const Similarity& S) const {
  const Eigen::Matrix3d R = S.rotation.toRotationMatrix();
  Matrix7d adjoint = Matrix7d::Identity();
  adjoint.topLeftCorner<3, 3>() = S.scale * R;
  adjoint.block<3, 3>(0, 3) = Skew(S.translation) * R;
  adjoint.block<3, 3>(3, 3) = R;
  if (options_.kind == GraphKind::kSim3) adjoint.block<3, 1>(0, 6) = -S.translation;
  return adjoint;
}

bool KeyframeGraph::Rehang(const std::map<int, int>& into, LoopEdge* loop) const {
  const double floor = SigmaFloor();
  const auto covariance = [&](const Edge& edge) -> Matrix7d {  // in the newer one's frame of reference
    return Sigmas(edge, floor).array().square().matrix().asDiagonal();
  };
  for (auto next = into.find(loop->candidate); next != into.end(); next = into.find(loop->candidate)) {
    const Edge link = Between(next->second, next->first);
    const Matrix7d in_query = Adjoint(loop->S_candidate_query.Inverse());
    loop->information = LessSure(loop->information, in_query * covariance(link) * in_query.transpose());
    loop->S_candidate_query = link.S_older_newer * loop->S_candidate_query;
    loop->depth *= link.S_older_newer.scale;
    loop->candidate = next->second;
  }
  for (auto next = into.find(loop->query); next != into.end(); next = into.find(loop->query)) {
    const Edge link = Between(next->second, next->first);
    const Similarity S_removed_other = link.S_older_newer.Inverse();
    const Matrix7d to_removed = Adjoint(S_removed_other);
    loop->information = to_removed.transpose() * LessSure(loop->information, covariance(link)) * to_removed;
    loop->S_candidate_query = loop->S_candidate_query * S_removed_other;
    loop->query = next->second;
  }
  return loop->candidate != loop->query;
}

}  // namespace tutti
