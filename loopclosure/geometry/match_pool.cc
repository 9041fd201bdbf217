
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "core/numbers.h"
#include "core/parallel.h"
#include "loopclosure/geometry/matching.h"

namespace tutti::internal {
namespace {

const Eigen::Vector3f kUnknown = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());

Eigen::Vector3f PointOf(const View::Set& set, int index) {
  return set.points.empty() ? kUnknown : set.points[Index(index)];
}

int NumberOf(const View::Set& set, int index) {
  return set.numbers.empty() ? index : set.numbers[Index(index)];
}

void AppendMatches(const View::Set& query, const View::Set& candidate, const std::vector<Match>& matches,
                   bool is_caller, std::vector<PooledMatch>& pool) {
  for (const Match& m : matches) {
    PooledMatch match;
    match.query = query.pixels[Index(m.query)];
    match.candidate = candidate.pixels[Index(m.candidate)];
    match.query_point = PointOf(query, m.query);
    match.candidate_point = PointOf(candidate, m.candidate);
    if (is_caller) {
      match.query_feature = NumberOf(query, m.query);
      match.candidate_feature = NumberOf(candidate, m.candidate);
    }
    match.ratio = m.ratio;
    pool.push_back(match);
  }
}

// All members find the same corners: one match per place in either image, so that inliers count independent
// evidence. The caller's come first (the SLAM map hangs on them), then the most certain.
std::vector<PooledMatch> OnePerPlace(std::vector<PooledMatch> pool) {
  constexpr float kCell = 4.0f;  // [px]
  std::stable_sort(pool.begin(), pool.end(), [](const PooledMatch& a, const PooledMatch& b) {
    const bool caller_a = a.query_feature >= 0;
    const bool caller_b = b.query_feature >= 0;
    return caller_a != caller_b ? caller_a : a.ratio < b.ratio;
  });
  const auto cell = [](const cv::Point2f& p) {
    return std::make_pair(static_cast<int>(std::floor(p.x / kCell)),
                          static_cast<int>(std::floor(p.y / kCell)));
  };
  std::set<std::pair<int, int>> used_query;
  std::set<std::pair<int, int>> used_candidate;
  std::vector<PooledMatch> kept;
  for (const PooledMatch& match : pool) {
    const auto q = cell(match.query);
    const auto c = cell(match.candidate);
    if (used_query.count(q) > 0 || used_candidate.count(c) > 0) continue;
    used_query.insert(q);
    used_candidate.insert(c);
    kept.push_back(match);
  }
  return kept;
}

}  // namespace

std::vector<PooledMatch> PoolMatches(const View& query, const View& candidate, double max_ratio,
                                     int threads) {
  const std::size_t members = std::min(query.members.size(), candidate.members.size());
  std::vector<std::vector<Match>> matches(members + 1);
  RunParallel(static_cast<int>(members) + 1, threads, [&](int task) {
    const std::size_t k = Index(task);
    const View::Set& q = k < members ? query.members[k] : query.caller;
    const View::Set& c = k < members ? candidate.members[k] : candidate.caller;
    matches[k] = MatchDescriptors(q.descriptors.Unpacked(), c.descriptors.Unpacked(), c.pixels, max_ratio);
  });
  std::vector<PooledMatch> pool;
  AppendMatches(query.caller, candidate.caller, matches[members], true, pool);
  for (std::size_t k = 0; k < members; ++k) {
    AppendMatches(query.members[k], candidate.members[k], matches[k], false, pool);
  }
  return OnePerPlace(std::move(pool));
}

}  // namespace tutti::internal
