// Evaluation of a trajectory against a reference: absolute and relative errors, and KITTI's odometry errors.
//
// The conventions are those of evo (Grupp, 2017) and the numbers agree with it: association by nearest time
// stamp, alignment of the estimate to the reference by Umeyama's method (PAMI 13(4) 1991), population
// standard deviation.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "tutti/core/pose.h"
#include "tutti/core/trajectory.h"

namespace tutti {

/// kOrigin puts the first pose of the estimate on the reference's; kSE3 and kSim3 minimise the squared
/// distances.
enum class TrajectoryAlignment { kNone, kOrigin, kSE3, kSim3 };
/// "none", "origin", "se3", "sim3". Throws InputError for another word.
TrajectoryAlignment ParseTrajectoryAlignment(const std::string& name);
const char* ToString(TrajectoryAlignment alignment);

/// Distance between the two poses of a relative error.
enum class DeltaUnit { kFrames, kMetres };

struct EvaluationOptions {
  TrajectoryAlignment alignment = TrajectoryAlignment::kSE3;
  double max_time_difference_s = 0.01;  ///< pairs further apart in time are not associated [s]
  bool by_index = false;   ///< pair poses by position (KITTI) instead of by time; the counts must agree
  double rpe_delta = 1.0;  ///< distance of a relative error's two poses, in rpe_unit
  DeltaUnit rpe_unit = DeltaUnit::kFrames;
  bool rpe_all_pairs = false;  ///< every start pose instead of consecutive pieces
  double rpe_tolerance = 0.1;  ///< all pairs in metres: allowed deviation as a fraction of rpe_delta [1]
  bool kitti = true;           ///< KITTI's segment errors too (100 to 800 m; nothing if the path is shorter)
  std::string Validate() const;
};

/// Figures of a list of errors, in its unit (sse: squared).
struct ErrorStatistics {
  std::size_t count = 0;
  double rmse = 0, mean = 0, median = 0, std = 0, min = 0, max = 0, sse = 0;
};
ErrorStatistics Summarize(std::vector<double> errors);

/// Poses of the same moment.
struct AssociatedPoses {
  std::vector<double> stamps_s;                              ///< of the estimate
  std::vector<std::pair<std::size_t, std::size_t>> indices;  ///< (reference, estimate)
  std::vector<Pose> reference, estimate;
};

/// Nearest neighbours in time, for each pose of the shorter trajectory (the estimate where they are equally
/// long). Throws InputError that names both time ranges if nothing matches.
AssociatedPoses AssociateByTime(const Trajectory& reference, const Trajectory& estimate,
                                double max_difference_s);
/// By position. Throws InputError if the counts differ.
AssociatedPoses AssociateByIndex(const Trajectory& reference, const Trajectory& estimate);

/// S_reference_estimate that minimises sum ||reference - S * estimate||^2 (scale 1 unless `with_scale`).
/// Throws InputError with fewer than 3 points or if they lie on a line (or in one place), for then the
/// rotation is not determined.
Similarity AlignPoints(const std::vector<Eigen::Vector3d>& reference,
                       const std::vector<Eigen::Vector3d>& estimate, bool with_scale);
/// The alignment of associated poses. Same errors as AlignPoints for kSE3 and kSim3.
Similarity AlignPoses(const AssociatedPoses& poses, TrajectoryAlignment alignment);
/// Applies S_reference_estimate: positions move, rotate and scale, orientations rotate.
Pose ApplyAlignment(const Similarity& S_reference_estimate, const Pose& pose);

/// Per-pair absolute errors: distance [m] and rotation angle [deg].
std::vector<double> AbsoluteTranslationErrors(const AssociatedPoses& poses);
std::vector<double> AbsoluteRotationErrors(const AssociatedPoses& poses);

/// Pairs of positions in the list, `delta` apart along the estimate.
std::vector<std::pair<std::size_t, std::size_t>> RelativePairs(const std::vector<Pose>& estimate,
                                                               const EvaluationOptions& options);

/// KITTI's odometry errors: over all segments of 100, 200, ..., 800 m, started at every 10th pose (Geiger et
/// al., CVPR 2012).
struct KittiErrors {
  std::size_t segments = 0;        ///< 0: the path is shorter than 100 m
  double translation_percent = 0;  ///< mean translation error over the segment's length [%]
  double rotation_deg_per_m = 0;   ///< mean rotation error over the segment's length [deg/m]
};
KittiErrors EvaluateKitti(const std::vector<Pose>& reference, const std::vector<Pose>& estimate);

struct EvaluationReport {
  std::size_t pairs = 0;  ///< associated poses
  std::size_t reference_poses = 0, estimate_poses = 0;
  TrajectoryAlignment alignment = TrajectoryAlignment::kSE3;
  Similarity S_reference_estimate;  ///< the alignment that was applied
  double path_length_m = 0;         ///< of the associated reference poses
  ErrorStatistics ate;              ///< [m]
  ErrorStatistics ate_rotation;     ///< [deg]
  ErrorStatistics rpe;              ///< [m]; count 0 if no pair is rpe_delta apart
  ErrorStatistics rpe_rotation;     ///< [deg]
  KittiErrors kitti;
};

/// Associates, aligns and measures. Throws InputError as the functions above do.
EvaluationReport EvaluateTrajectory(const Trajectory& reference, const Trajectory& estimate,
                                    const EvaluationOptions& options = {});

}  // namespace tutti
