#include "tutti/loopclosure/verification.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <limits>
#include <set>

#include "epipolar.h"
#include "evidence.h"
#include "tutti/loopclosure/matching.h"
#include "tutti/loopclosure/parallel.h"
#include "tutti/loopclosure/relative_pose.h"

namespace tutti {
namespace {

// A match of the pool, with what is known about its ends.
struct PooledMatch {
  cv::Point2f query, candidate;
  Eigen::Vector3f query_point, candidate_point;  // NaN where unknown
  int query_feature = -1, candidate_feature = -1;
  float ratio = 1;
};

constexpr double kLeastSpreadShare = 0.6;  // of min_spread, however many the inliers

const Eigen::Vector3f kUnknown = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());

Eigen::Vector3f PointOf(const View::Set& set, int index) {
  return set.points.empty() ? kUnknown : set.points[static_cast<std::size_t>(index)];
}

void AppendMatches(const View::Set& query, const View::Set& candidate, const std::vector<Match>& matches,
                   bool is_caller, std::vector<PooledMatch>& pool) {
  for (const Match& m : matches) {
    PooledMatch match;
    match.query = query.pixels[static_cast<std::size_t>(m.query)];
    match.candidate = candidate.pixels[static_cast<std::size_t>(m.candidate)];
    match.query_point = PointOf(query, m.query);
    match.candidate_point = PointOf(candidate, m.candidate);
    if (is_caller) {
      match.query_feature = m.query;
      match.candidate_feature = m.candidate;
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

std::vector<PooledMatch> Pool(const View& query, const View& candidate, double max_ratio, int threads) {
  const std::size_t members = std::min(query.members.size(), candidate.members.size());
  std::vector<std::vector<Match>> matches(members + 1);
  RunParallel(static_cast<int>(members) + 1, threads, [&](int task) {
    const std::size_t k = static_cast<std::size_t>(task);
    const View::Set& q = k < members ? query.members[k] : query.caller;
    const View::Set& c = k < members ? candidate.members[k] : candidate.caller;
    matches[k] = MatchDescriptors(q.descriptors, c.descriptors, c.pixels, max_ratio);
  });
  std::vector<PooledMatch> pool;
  AppendMatches(query.caller, candidate.caller, matches[members], true, pool);
  for (std::size_t k = 0; k < members; ++k) {
    AppendMatches(query.members[k], candidate.members[k], matches[k], false, pool);
  }
  return OnePerPlace(std::move(pool));
}

// Standard deviation of the pixels along their narrowest direction, x as a share of the width and y of the
// height: matches on one line or in one spot fit many camera motions.
double Spread(const std::vector<cv::Point2f>& pixels, const cv::Size& size) {
  if (pixels.empty() || size.empty()) return 0.0;
  const double n = static_cast<double>(pixels.size());
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> scaled;
  for (const cv::Point2f& p : pixels) {
    scaled.emplace_back(p.x / size.width, p.y / size.height);
    mean += scaled.back() / n;
  }
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& p : scaled) covariance += (p - mean) * (p - mean).transpose() / n;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()[0]));
}

__attribute__((format(printf, 1, 2))) std::string Format(const char* format, ...) {
  std::array<char, 200> text{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text.data(), text.size(), format, arguments);
  va_end(arguments);
  return text.data();
}

// What the inliers are worth, whatever the bars say of them.
void FillEvidence(const std::vector<cv::Point2f>& in_query, const std::vector<cv::Point2f>& in_candidate,
                  const View& query, const View& candidate, const VerificationOptions& options,
                  Verification& result) {
  const bool rigid = result.type == ConstraintType::kRigid;
  const internal::FitModel model = rigid ? internal::FitModel::kPnp
                                   : result.type == ConstraintType::kEssential
                                       ? internal::FitModel::kEssential
                                       : internal::FitModel::kFundamental;
  const internal::ChanceFit chance =
      internal::FitByChance(model, result.matches, result.inliers,
                            rigid ? options.reprojection_px : options.epipolar_px, query.size);
  result.expected_inliers = chance.expected;
  result.log_nfa = chance.log_nfa;
  result.coverage = std::min(internal::OccupiedCells(in_query, query.size),
                             internal::OccupiedCells(in_candidate, candidate.size));
  result.motion_spread = internal::MotionSpread(in_query, in_candidate, query.size);
}

// Fills counts, evidence and matched pixels, and says what the inliers lack; empty if nothing.
std::string Judge(const std::vector<PooledMatch>& pool, const std::vector<int>& inliers,
                  std::size_t considered, const View& query, const View& candidate,
                  const VerificationOptions& options, Verification& result) {
  result.matches = static_cast<int>(considered);
  result.inliers = static_cast<int>(inliers.size());
  result.inlier_matches.clear();
  std::vector<cv::Point2f> in_query;
  std::vector<cv::Point2f> in_candidate;
  for (const int i : inliers) {
    const PooledMatch& m = pool[static_cast<std::size_t>(i)];
    result.inlier_matches.push_back({m.query, m.candidate, m.query_feature, m.candidate_feature});
    in_query.push_back(m.query);
    in_candidate.push_back(m.candidate);
  }
  FillEvidence(in_query, in_candidate, query, candidate, options, result);
  const bool rigid = result.type == ConstraintType::kRigid;
  const int min_inliers = rigid ? options.min_inliers : options.min_epipolar_inliers;
  const double min_ratio = rigid ? options.min_inlier_ratio : options.min_epipolar_ratio;
  if (result.inliers < min_inliers) {
    return Format("only %d matches fit one camera motion, %d are needed", result.inliers, min_inliers);
  }
  const double ratio = static_cast<double>(inliers.size()) / static_cast<double>(considered);
  if (ratio < min_ratio) {
    return Format("only %.0f %% of the matches fit one camera motion, %.0f %% are needed", 100 * ratio,
                  100 * min_ratio);
  }
  // What a motion is known by grows with number times spread squared: many inliers may lie closer together.
  const double abundance = std::sqrt(1.5 * min_inliers / static_cast<double>(result.inliers));
  const double needed = options.min_spread * std::clamp(abundance, kLeastSpreadShare, 1.0);
  const double spread = std::min(Spread(in_query, query.size), Spread(in_candidate, candidate.size));
  if (spread < needed) {
    return Format("the matches cover too narrow a part of the image (%.3f of its size, %.3f is needed)",
                  spread, needed);
  }
  return {};
}

RelativePoseOptions PoseOptions(const VerificationOptions& options, std::uint64_t seed) {
  RelativePoseOptions pose;
  pose.threshold_px = options.reprojection_px;
  pose.pixel_sigma = options.pixel_sigma;
  pose.min_inliers = 6;  // the verifier judges the number itself, with its own words
  pose.confidence = options.confidence;
  pose.max_iterations = options.max_iterations;
  pose.seed = seed;
  return pose;
}

Eigen::Vector2d Pixel(const cv::Point2f& p) { return {p.x, p.y}; }

// PnP on the candidate's points in metres. False if too few matches have one, so that something else must
// decide.
bool VerifyRigid(const std::vector<PooledMatch>& pool, const View& query, const View& candidate,
                 const VerificationOptions& options, std::uint64_t seed, Verification& result) {
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
  for (const int i : pnp.inliers) inliers.push_back(index[static_cast<std::size_t>(i)]);
  result.type = ConstraintType::kRigid;
  result.reason = Judge(pool, inliers, points.size(), query, candidate, options, result);
  result.accepted = result.reason.empty();
  result.S_candidate_query = Similarity(pnp.T_camera_points.Inverse());
  result.information = pnp.information;
  return true;
}

// Mono: 3D-3D where both images have points. Called after the essential matrix has accepted.
void AddSimilarity(const std::vector<PooledMatch>& pool, const std::vector<int>& epipolar_inliers,
                   const View& query, const View& candidate, const VerificationOptions& options,
                   std::uint64_t seed, Verification& result) {
  constexpr int kEnoughPoints = 20;  // on so many, a similarity must be found
  constexpr int kMinInliers = 12;
  std::vector<Eigen::Vector3d> points_c, points_q;
  std::vector<Eigen::Vector2d> pixels_c, pixels_q;
  for (const int i : epipolar_inliers) {
    const PooledMatch& m = pool[static_cast<std::size_t>(i)];
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
  if (!fit.success) {
    if (static_cast<int>(points_c.size()) < kEnoughPoints) return;
    result.accepted = false;
    result.reason = "the landmarks of the two images don't fit together: " + fit.reason;
    return;
  }
  result.type = ConstraintType::kSimilarity;
  result.S_candidate_query = fit.S_a_b;
  // The scale is estimated with the pose: what is known of the pose alone is the Schur complement over it.
  const Vector6d cross = fit.information.topRightCorner<6, 1>();
  result.information = fit.information.topLeftCorner<6, 6>();
  if (fit.information(6, 6) > 0) result.information -= cross * cross.transpose() / fit.information(6, 6);
}

// Share of the translation along the candidate's optical axis, from the pixel of the query's centre in it.
// The focal length is a guess that most cameras are within a factor of two of.
double AheadFromEpipole(const Eigen::Vector3d& epipole, const cv::Size& size) {
  const double focal = 0.8 * std::max(size.width, size.height);
  const Eigen::Vector3d direction(epipole.x() - 0.5 * size.width * epipole.z(),
                                  epipole.y() - 0.5 * size.height * epipole.z(), focal * epipole.z());
  return direction.norm() > 0 ? std::abs(direction.z()) / direction.norm() : 1.0;
}

void VerifyEpipolar(const std::vector<PooledMatch>& pool, const View& query, const View& candidate,
                    const VerificationOptions& options, std::uint64_t seed, Verification& result) {
  std::vector<cv::Point2f> pixels_q;
  std::vector<cv::Point2f> pixels_c;
  for (const PooledMatch& m : pool) {
    pixels_q.push_back(m.query);
    pixels_c.push_back(m.candidate);
  }
  const internal::EpipolarSettings settings{options.epipolar_px, options.confidence, options.max_iterations,
                                            seed};
  const bool calibrated = query.camera && candidate.camera;
  const internal::EpipolarResult fit =
      calibrated ? internal::FitEssential(pixels_c, *candidate.camera, pixels_q, *query.camera, settings)
                 : internal::FitFundamental(pixels_c, pixels_q, settings);
  result.type = calibrated ? ConstraintType::kEssential : ConstraintType::kFundamental;
  result.reason = Judge(pool, fit.inliers, pool.size(), query, candidate, options, result);
  result.accepted = result.reason.empty();
  result.ahead = AheadFromEpipole(fit.epipole, candidate.size);
  if (calibrated) {
    result.S_candidate_query = Similarity(fit.T_second_first.Inverse());
    result.ahead = std::abs(result.S_candidate_query.translation.normalized().z());
  }
  if (calibrated && result.accepted && !(query.metric && candidate.metric)) {
    AddSimilarity(pool, fit.inliers, query, candidate, options, seed, result);
  }
}

}  // namespace

Verification GeometricVerifier::Verify(const View& query, const View& candidate, int threads) const {
  Verification result;
  result.candidate = candidate.id;
  const std::vector<PooledMatch> pool = Pool(query, candidate, options_.match_ratio, threads);
  result.matches = static_cast<int>(pool.size());
  if (result.matches < options_.min_inliers) {
    result.reason = Format("only %d features match, %d are needed", result.matches, options_.min_inliers);
    return result;
  }
  const std::uint64_t seed = seed_ + 0x9e3779b97f4a7c15ull * static_cast<std::uint64_t>(query.id) +
                             static_cast<std::uint64_t>(candidate.id);
  if (query.camera && candidate.metric && query.metric &&
      VerifyRigid(pool, query, candidate, options_, seed, result)) {
    return result;
  }
  VerifyEpipolar(pool, query, candidate, options_, seed, result);
  return result;
}

}  // namespace tutti
