// The motion of the camera between two views by pixels alone. Internal.
#pragma once

#include <cstdint>
#include <vector>

#include "loopclosure/geometry/evidence.h"
#include "loopclosure/geometry/matching.h"
#include "loopclosure/geometry/verification.h"
#include "tutti/core/pose.h"

namespace tutti::internal {

/// What explains the most of the matches.
struct Motion {
  ConstraintType type = ConstraintType::kFundamental;  ///< or kEssential
  bool homography = false;                             ///< the scene is flat, or the camera turned on the
                                                       ///< spot: a match is held to a point, not to a line
  std::vector<int> inliers;                            ///< of the pool, ascending
  int considered = 0;                                  ///< matches that could have been inliers
  int fewest = -1;         ///< several cameras: inliers of the one with the fewest, of those that see much in
                           ///< both images; -1: there is none
  ChanceFit chance;        ///< how many would be by chance
  Pose T_candidate_query;  ///< kEssential: unit translation; zero if the camera
                           ///< only turned
};

/// Essential matrix where both views have a camera, else fundamental matrix; a homography where that explains
/// nine tenths of what they do. Views of the same number of cameras (View::cameras): each with its like, or
/// each with its opposite (left with right, for a drive the other way) if that explains more; inliers and
/// evidence are summed.
Motion FitMotion(const std::vector<PooledMatch>& pool, const View& query, const View& candidate,
                 const VerificationOptions& options, std::uint64_t seed);

}  // namespace tutti::internal
