#include "apps/slam/false_loop_source.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <vector>

#include "apps/slam/loop_constraint.h"
#include "apps/slam/loop_gate.h"

namespace tutti {
namespace {

constexpr int kTries = 100;            // draws before it waits for a larger map
constexpr std::size_t kMinApart = 20;  // keyframes between the two ends
constexpr double kRadians = 0.017453292519943295;

}  // namespace

double FalseLoopSource::Symmetric(double limit) {
  return limit * (2 * static_cast<double>(random_() >> 11) * 0x1p-53 - 1);
}

Similarity FalseLoopSource::Draw(double length, double angle_rad) {
  const Eigen::Vector3d t(Symmetric(length), Symmetric(length), Symmetric(length));
  const Eigen::Vector3d r(Symmetric(angle_rad), Symmetric(angle_rad), Symmetric(angle_rad));
  return Similarity(1.0, ExpSO3(r), t);
}

Matrix7d FalseLoopSource::Information(double depth) const {
  return MakeInformation(options_.loop_sigma_fraction * depth, options_.loop_sigma_deg * kRadians,
                         options_.loop_sigma_scale);
}

// From the next keyframe after the last loop's candidate to the one before its query.
std::optional<LoopEdge> FalseLoopSource::Alike(const Odometry& odometry, const std::vector<int>& ids) const {
  if (!last_) return std::nullopt;
  const auto c = std::upper_bound(ids.begin(), ids.end(), last_->candidate);
  const auto q = std::lower_bound(ids.begin(), ids.end(), last_->query);
  if (c == ids.end() || q == ids.begin()) return std::nullopt;
  LoopEdge loop = *last_;
  loop.candidate = *c;
  loop.query = *(q - 1);
  const auto between = [&](int a, int b) {
    return Similarity(odometry.KeyframePose(a).Inverse() * odometry.KeyframePose(b));
  };
  loop.S_candidate_query = between(loop.candidate, last_->candidate) * last_->S_candidate_query *
                           between(last_->query, loop.query);
  return loop;
}

std::optional<LoopEdge> FalseLoopSource::Next(const Odometry& odometry, int query) {
  if (left_ == 0) return std::nullopt;
  const std::vector<int> ids = odometry.KeyframeIds();
  if (ids.size() < 2 * kMinApart) return std::nullopt;
  Eigen::AlignedBox3d box;
  for (const int id : ids) box.extend(odometry.KeyframePose(id).translation);
  for (int k = 0; k < kTries; ++k) {
    std::optional<LoopEdge> loop;
    if (made_ % 3 == 2) loop = Alike(odometry, ids);
    if (!loop) {
      loop.emplace();
      const std::size_t q =
          query >= 0 ? static_cast<std::size_t>(std::lower_bound(ids.begin(), ids.end(), query) - ids.begin())
                     : kMinApart + random_() % (ids.size() - kMinApart);
      if (q < kMinApart || q >= ids.size()) return std::nullopt;
      loop->candidate = ids[random_() % (q - kMinApart + 1)];
      loop->query = ids[q];
      loop->depth = MedianDepth(odometry.Keyframe(loop->candidate));
      const bool anywhere = made_ % 3 == 0;
      loop->S_candidate_query =
          anywhere ? Draw(0.5 * box.diagonal().norm(), M_PI / 2) : Draw(0.05 * loop->depth, 5 * kRadians);
      if (!(loop->depth > 0)) continue;
      loop->information = Information(loop->depth);
    }
    const Similarity S_query_candidate(odometry.KeyframePose(loop->query).Inverse() *
                                       odometry.KeyframePose(loop->candidate));
    const bool is_false = Measure(loop->S_candidate_query * S_query_candidate, loop->depth).fraction > 1;
    const bool joined = odometry.KeyframePiece(loop->candidate) == odometry.KeyframePiece(loop->query);
    if (!is_false || !joined) {
      last_.reset();
      continue;
    }
    loop->candidate_frame = odometry.KeyframeFrameIndex(loop->candidate);
    loop->query_frame = odometry.KeyframeFrameIndex(loop->query);
    last_ = loop;
    ++made_;
    --left_;
    return loop;
  }
  return std::nullopt;
}

}  // namespace tutti
