#include "loopclosure/geometry/motion.h"

#include <algorithm>
#include <iterator>
#include <numeric>

#include "core/numbers.h"
#include "loopclosure/geometry/epipolar.h"

namespace tutti::internal {
namespace {

// A homography decides where it explains this share of what the essential or fundamental matrix does: a flat
// scene, or a turn on the spot. The rest are points that noise has put on the right line.
constexpr double kHomographyShare = 0.9;

// The matches `of` the pool, of one camera each whose images have this size.
Motion FitOne(const std::vector<PooledMatch>& pool, const std::vector<int>& of, const View& query,
              const View& candidate, const cv::Size& size, const VerificationOptions& options,
              std::uint64_t seed) {
  std::vector<cv::Point2f> pixels_q;
  std::vector<cv::Point2f> pixels_c;
  for (const int i : of) {
    pixels_q.push_back(pool[Index(i)].query);
    pixels_c.push_back(pool[Index(i)].candidate);
  }
  EpipolarSettings settings;
  settings.threshold_px = options.epipolar_px;
  settings.seed = seed;
  const bool calibrated = query.camera && candidate.camera;
  const EpipolarResult lines =
      calibrated ? FitEssential(pixels_c, *candidate.camera, pixels_q, *query.camera, settings)
                 : FitFundamental(pixels_c, pixels_q, settings);
  Motion motion;
  motion.type = calibrated ? ConstraintType::kEssential : ConstraintType::kFundamental;
  motion.considered = static_cast<int>(of.size());
  if (calibrated) motion.T_candidate_query = lines.T_second_first.Inverse();
  std::vector<int> inliers = lines.inliers;
  if (options.homography_px > 0) {
    EpipolarSettings own = settings;
    own.threshold_px = options.homography_px;
    const HomographyResult points = FitHomography(pixels_c, candidate.camera, pixels_q, query.camera, own);
    std::vector<int> common;
    std::set_intersection(inliers.begin(), inliers.end(), points.inliers.begin(), points.inliers.end(),
                          std::back_inserter(common));
    motion.homography = !points.inliers.empty() && (static_cast<double>(common.size()) >=
                                                    kHomographyShare * static_cast<double>(inliers.size()));
    if (motion.homography) {
      inliers = points.inliers;
      if (points.turned) motion.T_candidate_query = Pose(points.R_second_first.conjugate(), {0, 0, 0});
    }
  }
  for (const int i : inliers) motion.inliers.push_back(of[Index(i)]);
  // What a homography explains fits lines as well: by lines, the figures of flat and of deep scenes compare.
  motion.chance = FitByChance(calibrated ? FitModel::kEssential : FitModel::kFundamental, motion.considered,
                              static_cast<int>(inliers.size()), options.epipolar_px, size);
  return motion;
}

// Features in a part of the image, of all members and the caller.
int FeaturesIn(const cv::Rect& part, const View& view) {
  std::ptrdiff_t count = 0;
  const auto add = [&](const View::Set& set) {
    count += std::count_if(set.pixels.begin(), set.pixels.end(),
                           [&](const cv::Point2f& p) { return part.contains(cv::Point(p)); });
  };
  for (const View::Set& set : view.members) add(set);
  add(view.caller);
  return static_cast<int>(count);
}

// The matches by the query's camera i and the candidate's i, or the last but i.
std::vector<std::vector<int>> ByCamera(const std::vector<PooledMatch>& pool, const View& query,
                                       const View& candidate, bool opposite) {
  const std::size_t count = query.cameras.size();
  std::vector<std::vector<int>> matches(count);
  for (std::size_t i = 0; i < count; ++i) {
    const cv::Rect& in_query = query.cameras[i];
    const cv::Rect& in_candidate = candidate.cameras[opposite ? count - 1 - i : i];
    for (std::size_t m = 0; m < pool.size(); ++m) {
      if (in_query.contains(cv::Point(pool[m].query)) && in_candidate.contains(cv::Point(pool[m].candidate)))
        matches[i].push_back(static_cast<int>(m));
    }
  }
  return matches;
}

Motion FitEach(const std::vector<PooledMatch>& pool, const std::vector<std::vector<int>>& by_camera,
               bool opposite, const View& query, const View& candidate, const VerificationOptions& options,
               std::uint64_t seed) {
  constexpr int kSeesMuch = 60;  // features: of fewer, none need be found again
  Motion sum;
  sum.homography = true;
  for (std::size_t i = 0; i < by_camera.size(); ++i) {
    const Motion one =
        FitOne(pool, by_camera[i], query, candidate, query.cameras[i].size(), options, seed + i);
    sum.inliers.insert(sum.inliers.end(), one.inliers.begin(), one.inliers.end());
    const std::size_t other = opposite ? by_camera.size() - 1 - i : i;
    if (std::min(FeaturesIn(query.cameras[i], query), FeaturesIn(candidate.cameras[other], candidate)) >=
        kSeesMuch) {
      const int inliers = static_cast<int>(one.inliers.size());
      sum.fewest = sum.fewest < 0 ? inliers : std::min(sum.fewest, inliers);
    }
    sum.chance.expected += one.chance.expected;
    sum.chance.log_nfa += one.chance.log_nfa;
    sum.homography = sum.homography && one.homography;
  }
  std::sort(sum.inliers.begin(), sum.inliers.end());
  sum.considered = static_cast<int>(pool.size());
  return sum;
}

}  // namespace

Motion FitMotion(const std::vector<PooledMatch>& pool, const View& query, const View& candidate,
                 const VerificationOptions& options, std::uint64_t seed) {
  if (query.cameras.size() > 1 && query.cameras.size() == candidate.cameras.size()) {
    Motion same =
        FitEach(pool, ByCamera(pool, query, candidate, false), false, query, candidate, options, seed);
    const std::vector<std::vector<int>> crosswise = ByCamera(pool, query, candidate, true);
    std::size_t most = 0;  // inliers that there can be
    for (const std::vector<int>& matches : crosswise) most += matches.size();
    if (most <= same.inliers.size()) return same;
    Motion opposite = FitEach(pool, crosswise, true, query, candidate, options, seed);
    return opposite.inliers.size() > same.inliers.size() ? opposite : same;
  }
  std::vector<int> all(pool.size());
  std::iota(all.begin(), all.end(), 0);
  return FitOne(pool, all, query, candidate, query.size, options, seed);
}

}  // namespace tutti::internal
