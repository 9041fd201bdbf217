#include "loopclosure/geometry/verification.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "core/numbers.h"
#include "loopclosure/geometry/evidence.h"
#include "loopclosure/geometry/matching.h"
#include "loopclosure/geometry/motion.h"
#include "tutti/loopclosure/relative_pose.h"

namespace tutti {
namespace {

using internal::PooledMatch;

// What is verified, and how.
struct Pair {
  const View& query;
  const View& candidate;
  const VerificationOptions& options;
  std::uint64_t seed;
};

__attribute__((format(printf, 1, 2))) std::string Format(const char* format, ...) {
  std::array<char, 200> text{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text.data(), text.size(), format, arguments);
  va_end(arguments);
  return text.data();
}

// The least number of inliers and the least share of the matches.
struct Bars {
  int inliers = 0;
  double ratio = 0;
};

Bars BarsFor(const Verification& result, const VerificationOptions& options) {
  const bool rigid = result.type == ConstraintType::kRigid;
  Bars bars;
  bars.inliers = rigid || result.homography ? options.min_inliers : options.min_epipolar_inliers;
  bars.ratio = rigid ? options.min_inlier_ratio : options.min_epipolar_ratio;
  return bars;
}

// Fewer inliers by lines than a constraint needs, but so many of the matches that no chance explains them.
// Motions by fewer than kLeast are wrong by several degrees, wherever the place is right. Of points, chance
// explains hardly any: their number alone counts.
bool BeyondChance(const Verification& result) {
  constexpr double kLogNfa = -25;
  constexpr int kLeast = 20;
  return result.type != ConstraintType::kRigid && result.log_nfa <= kLogNfa && result.inliers >= kLeast;
}

// Fills counts, evidence, matched pixels, `similar` and `accepted`, and what the inliers lack.
void Judge(const std::vector<PooledMatch>& pool, const std::vector<int>& inliers,
           const internal::ChanceFit& chance, int considered, const Pair& pair, Verification& result) {
  const auto& [query, candidate, options, seed] = pair;
  result.matches = considered;
  result.inliers = static_cast<int>(inliers.size());
  result.inlier_matches.clear();
  std::vector<cv::Point2f> in_query;
  std::vector<cv::Point2f> in_candidate;
  for (const int i : inliers) {
    const PooledMatch& m = pool[internal::Index(i)];
    result.inlier_matches.push_back({m.query, m.candidate, m.query_feature, m.candidate_feature});
    in_query.push_back(m.query);
    in_candidate.push_back(m.candidate);
  }
  result.expected_inliers = chance.expected;
  result.log_nfa = chance.log_nfa;
  result.coverage = std::min(internal::OccupiedCells(in_query, query.size),
                             internal::OccupiedCells(in_candidate, candidate.size));
  result.motion_spread = internal::MotionSpread(in_query, in_candidate, query.size);
  const Bars bars = BarsFor(result, options);
  const double ratio = static_cast<double>(inliers.size()) / static_cast<double>(considered);
  const double needed = internal::SpreadNeeded(options.min_spread, bars.inliers, std::max(1, result.inliers));
  const double spread = std::min(internal::NarrowestSpread(in_query, query.size),
                                 internal::NarrowestSpread(in_candidate, candidate.size));
  const bool many = result.inliers >= bars.inliers || BeyondChance(result);
  const bool most = ratio >= bars.ratio || BeyondChance(result);
  const bool wide = spread >= needed;
  const bool by_chance = result.log_nfa >= 0;  // one such motion is to be expected of matches of nothing
  result.similar = result.inliers >= options.min_place_inliers && wide &&
                   ratio >= options.min_epipolar_ratio && !by_chance;
  result.accepted = many && most && wide;
  if (!many) {
    result.reason =
        Format("only %d matches fit one camera motion, %d are needed", result.inliers, bars.inliers);
  } else if (!most) {
    result.reason = Format("only %.0f %% of the matches fit one camera motion, %.0f %% are needed",
                           100 * ratio, 100 * bars.ratio);
  } else if (!wide) {
    result.reason =
        Format("the matches cover too narrow a part of the image (%.3f of its size, %.3f is needed)", spread,
               needed);
  }
}

RelativePoseOptions PoseOptions(const VerificationOptions& options, std::uint64_t seed) {
  RelativePoseOptions pose;
  pose.threshold_px = options.reprojection_px;
  pose.min_inliers = 6;  // the verifier judges the number itself, with its own words
  pose.seed = seed;
  return pose;
}

Eigen::Vector2d Pixel(const cv::Point2f& p) { return {p.x, p.y}; }

// PnP on the candidate's points in metres. False if too few matches have one, so that something else must
// decide.
bool VerifyRigid(const std::vector<PooledMatch>& pool, const Pair& pair, Verification& result) {
  const auto& [query, candidate, options, seed] = pair;
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  std::vector<int> index;
  for (std::size_t i = 0; i < pool.size(); ++i) {
    if (!pool[i].candidate_point.allFinite()) continue;
    points.push_back(pool[i].candidate_point.cast<double>());
    pixels.push_back(Pixel(pool[i].query));
    index.push_back(static_cast<int>(i));
  }
  if (static_cast<int>(points.size()) < options.min_inliers) return false;
  const PnpResult pnp = SolvePnp(points, pixels, *query.camera, PoseOptions(options, seed));
  std::vector<int> inliers;
  for (const int i : pnp.inliers) inliers.push_back(index[internal::Index(i)]);
  result.type = ConstraintType::kRigid;
  const int considered = static_cast<int>(points.size());
  const internal::ChanceFit chance =
      internal::FitByChance(internal::FitModel::kPnp, considered, static_cast<int>(inliers.size()),
                            options.reprojection_px, query.size);
  Judge(pool, inliers, chance, considered, pair, result);
  result.S_candidate_query = Similarity(pnp.T_camera_points.Inverse());
  result.information = pnp.information;
  return true;
}

// Mono: 3D-3D where both images have points. Called after the pixels have accepted. Points that don't fit are
// no veto: those of an image that is new were seen twice, and err by more than pixels do; a place is right
// where a motion is not yet.
void AddSimilarity(const std::vector<PooledMatch>& pool, const std::vector<int>& inliers, const Pair& pair,
                   Verification& result) {
  const auto& [query, candidate, options, seed] = pair;
  constexpr int kMinInliers = 12;
  std::vector<Eigen::Vector3d> points_c, points_q;
  std::vector<Eigen::Vector2d> pixels_c, pixels_q;
  for (const int i : inliers) {
    const PooledMatch& m = pool[internal::Index(i)];
    if (!m.candidate_point.allFinite() || !m.query_point.allFinite()) continue;
    points_c.push_back(m.candidate_point.cast<double>());
    points_q.push_back(m.query_point.cast<double>());
    pixels_c.push_back(Pixel(m.candidate));
    pixels_q.push_back(Pixel(m.query));
  }
  if (static_cast<int>(points_c.size()) < kMinInliers) return;
  RelativePoseOptions pose = PoseOptions(options, seed);
  pose.threshold_px = 2.0 * options.reprojection_px;  // both ends are triangulated
  pose.min_inliers = kMinInliers;
  const SimilarityResult fit =
      SolveSimilarity(points_c, pixels_c, *candidate.camera, points_q, pixels_q, *query.camera, pose);
  if (!fit.success) return;
  result.type = ConstraintType::kSimilarity;
  result.S_candidate_query = fit.S_a_b;
  // The scale is estimated with the pose: what is known of the pose alone is the Schur complement over it.
  const Vector6d cross = fit.information.topRightCorner<6, 1>();
  result.information = fit.information.topLeftCorner<6, 6>();
  if (fit.information(6, 6) > 0) result.information -= cross * cross.transpose() / fit.information(6, 6);
}

void VerifyByPixels(const std::vector<PooledMatch>& pool, const Pair& pair, Verification& result) {
  const auto& [query, candidate, options, seed] = pair;
  const internal::Motion motion = internal::FitMotion(pool, query, candidate, options, seed);
  result.type = motion.type;
  result.homography = motion.homography;
  Judge(pool, motion.inliers, motion.chance, motion.considered, pair, result);
  if (result.similar && motion.fewest >= 0) {
    // Each that sees much must find its share: a facade that exists twice is on one side only.
    const double even = BarsFor(result, options).inliers / static_cast<double>(query.cameras.size());
    const int needed = static_cast<int>(std::ceil(even));
    if (motion.fewest < needed) {
      result.reason = Format("one of the cameras knows nothing of it (%d of its matches fit, %d are needed)",
                             motion.fewest, needed);
      result.similar = result.accepted = false;
    }
  }
  const bool calibrated = motion.type == ConstraintType::kEssential;
  if (calibrated) result.S_candidate_query = Similarity(motion.T_candidate_query);
  if (calibrated && result.accepted && !(query.metric && candidate.metric)) {
    AddSimilarity(pool, motion.inliers, pair, result);
  }
}

// By the geometry that is known, all bars but those on what does not move.
Verification Decide(const std::vector<PooledMatch>& pool, const Pair& pair) {
  const auto& [query, candidate, options, seed] = pair;
  Verification result;
  result.candidate = candidate.id;
  result.matches = static_cast<int>(pool.size());
  if (result.matches < options.min_place_inliers) {
    result.reason =
        Format("only %d features match, %d are needed", result.matches, options.min_place_inliers);
    return result;
  }
  if (query.camera && candidate.metric && query.metric && VerifyRigid(pool, pair, result)) {
    return result;
  }
  VerifyByPixels(pool, pair, result);
  return result;
}

// Where most inliers are at the same pixel in both images, either the camera stands where it stood and sees
// the same everywhere, or it carries them along: then the others must do without them.
void DoWithoutStatic(const std::vector<PooledMatch>& pool, const Pair& pair, Verification& result) {
  const auto& [query, candidate, options, seed] = pair;
  constexpr double kMostApart = 0.15;
  std::vector<VerifiedMatch> still;
  for (const VerifiedMatch& match : result.inlier_matches) {
    if (internal::StaysAtItsPixel(match, options.static_px)) still.push_back(match);
  }
  if (2 * still.size() <= result.inlier_matches.size()) return;
  if (internal::ShareApart(still, query, candidate) <= kMostApart) return;
  std::vector<PooledMatch> moving;
  for (const PooledMatch& m : pool) {
    if (!internal::StaysAtItsPixel({m.query, m.candidate, -1, -1}, options.static_px)) moving.push_back(m);
  }
  const int all = result.inliers;
  result = Decide(moving, pair);  // and its evidence, whatever comes of it
  if (result.similar) return;
  result.reason =
      Format("only features that do not move with the camera agree (%d of %d are at the same pixel)",
             static_cast<int>(still.size()), all);
}

}  // namespace

Verification GeometricVerifier::Verify(const View& query, const View& candidate, int threads) const {
  const std::vector<PooledMatch> pool =
      internal::PoolMatches(query, candidate, options_.match_ratio, threads);
  const std::uint64_t seed = seed_ + 0x9e3779b97f4a7c15ull * static_cast<std::uint64_t>(query.id) +
                             static_cast<std::uint64_t>(candidate.id);
  const Pair pair = {query, candidate, options_, seed};
  Verification result = Decide(pool, pair);
  if (result.similar && options_.static_px > 0) {
    DoWithoutStatic(pool, pair, result);
  }
  return result;
}

}  // namespace tutti
