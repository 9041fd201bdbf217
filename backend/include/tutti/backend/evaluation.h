// Evaluation of a trajectory against a reference: absolute and relative errors, and KITTI's odometry errors.
//
// The conventions are those of evo (Grupp, 2017) and the numbers agree with it: association by nearest time
// stamp, alignment of the estimate to the reference by Umeyama's method (PAMI 13(4) 1991), population
// standard deviation.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tutti/core/pose.h"
#include "tutti/core/trajectory.h"

#pragma GCC visibility push(default)
namespace tutti {

/// kOrigin puts the first pose of the estimate on the reference's; kSE3 and kSim3 minimise the squared
/// distances; kScale applies the scale of kSim3 alone (as evo's --correct_scale without --align); kYaw turns
/// about one axis and moves, for estimates that know the vertical (Zhang and Scaramuzza, IROS 2018).
enum class TrajectoryAlignment { kNone, kOrigin, kSE3, kSim3, kScale, kYaw };
/// "none", "origin", "se3", "sim3", "scale", "yaw".
const std::vector<std::string>& TrajectoryAlignmentNames();
/// Throws InputError for another word.
TrajectoryAlignment ParseTrajectoryAlignment(const std::string& name);
const char* ToString(TrajectoryAlignment alignment);

/// Distance between the two poses of a relative error: along the path, in accumulated rotation (all pairs:
/// rotation between the two), in time.
enum class DeltaUnit { kFrames, kMetres, kDegrees, kSeconds, kRadians };
/// "frames", "metres", "degrees", "seconds", "radians".
const std::vector<std::string>& DeltaUnitNames();
/// Throws InputError for another word.
DeltaUnit ParseDeltaUnit(const std::string& name);
const char* ToString(DeltaUnit unit);

/// Planes that poses can be projected to after the alignment (evo's --project_to_plane): the third coordinate
/// becomes 0, the rotation that about the plane's normal.
enum class ProjectionPlane { kNone, kXY, kXZ, kYZ };
/// "none", "xy", "xz", "yz".
const std::vector<std::string>& ProjectionPlaneNames();
/// Throws InputError for another word.
ProjectionPlane ParseProjectionPlane(const std::string& name);
const char* ToString(ProjectionPlane plane);

/// A pose counts once the path since the last that counted is so long, or the rotation since then so large
/// (evo's --motion_filter).
struct MotionFilter {
  double distance_m = 0;  ///< along the path [m]
  double angle_deg = 0;   ///< [deg]
};

struct EvaluationOptions {
  TrajectoryAlignment alignment = TrajectoryAlignment::kSE3;
  std::size_t align_first = 0;  ///< poses from the start that the alignment is computed from; 0: all
  Eigen::Vector3d vertical = Eigen::Vector3d::UnitZ();  ///< kYaw: the axis to turn about, in the reference
  double max_time_difference_s = 0.01;  ///< pairs further apart in time are not associated [s]
  double time_offset_s = 0;             ///< added to the estimate's time stamps [s]
  bool interpolate = false;          ///< the reference at the estimate's stamps instead of its nearest pose
  double max_interpolation_s = 0.2;  ///< interpolate: not between poses that are further apart in time [s]
  std::size_t downsample = 0;        ///< before the association, at most so many evenly spaced poses; 0: all
  std::optional<MotionFilter> motion_filter;       ///< before the association, after downsample
  ProjectionPlane plane = ProjectionPlane::kNone;  ///< after the alignment
  std::vector<double> frame_stamps_s;  ///< of all images, for the coverage [s]; empty: they are estimated
  bool by_index = false;   ///< pair poses by position (KITTI) instead of by time; the counts must agree
  double rpe_delta = 1.0;  ///< distance of a relative error's two poses, in rpe_unit
  DeltaUnit rpe_unit = DeltaUnit::kFrames;
  bool rpe_all_pairs = false;  ///< every start pose instead of consecutive pieces
  double rpe_tolerance = 0.1;  ///< all pairs but in frames: allowed deviation, fraction of rpe_delta [1]
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
  std::vector<double> stamps_s;                              ///< of the estimate, without the offset
  std::vector<std::pair<std::size_t, std::size_t>> indices;  ///< (reference, estimate)
  std::vector<Pose> reference, estimate;
};

/// Nearest neighbours in time, for each pose of the shorter trajectory (the estimate where they are equally
/// long). `offset_s` is added to the estimate's stamps. Throws InputError that names both time ranges if
/// nothing matches, and how far apart the nearest two poses are.
AssociatedPoses AssociateByTime(const Trajectory& reference, const Trajectory& estimate,
                                double max_difference_s, double offset_s = 0);
/// Each pose of the estimate with the reference interpolated at its time; (index of the reference: the pose
/// before). Same errors.
AssociatedPoses AssociateByInterpolation(const Trajectory& reference, const Trajectory& estimate,
                                         double max_gap_s, double offset_s = 0);
/// By position. Throws InputError if the counts differ.
AssociatedPoses AssociateByIndex(const Trajectory& reference, const Trajectory& estimate);

/// T_world_body at that time, interpolated (position: linear, rotation: slerp) between poses that are at most
/// `max_gap_s` apart; nothing outside of the trajectory.
std::optional<Pose> InterpolatePose(const Trajectory& trajectory, double stamp_s, double max_gap_s);

/// The reference's T_world_body of a frame: interpolated between poses that are at most 0.2 s apart; where
/// there are none (before the first pose, after the last), the nearest pose if it is at most half a frame
/// away in time. `frame_interval_s`: median time from frame to frame.
std::optional<Pose> PoseOfFrame(const Trajectory& reference, double stamp_s, double frame_interval_s);

/// S_reference_estimate that minimises sum ||reference - S * estimate||^2 (scale 1 unless `with_scale`).
/// Throws InputError with fewer than 3 points or if they lie on a line (or in one place), for then the
/// rotation is not determined.
Similarity AlignPoints(const std::vector<Eigen::Vector3d>& reference,
                       const std::vector<Eigen::Vector3d>& estimate, bool with_scale);
/// Rotation about `axis` (unit length) and translation that minimise the same sum. Throws InputError if fewer
/// than 2 points are given or all lie on one line along the axis.
Similarity AlignAboutAxis(const std::vector<Eigen::Vector3d>& reference,
                          const std::vector<Eigen::Vector3d>& estimate, const Eigen::Vector3d& axis);
/// The alignment of associated poses. Same errors as AlignPoints and AlignAboutAxis.
Similarity AlignPoses(const AssociatedPoses& poses, const EvaluationOptions& options);
/// Applies S_reference_estimate: positions move, rotate and scale, orientations rotate.
Pose ApplyAlignment(const Similarity& S_reference_estimate, const Pose& pose);

/// A rigid transform as a matrix. KITTI's files print rotations with few digits, so that their matrices are
/// not quite rotations; evo and KITTI's development kit measure with them as they are.
struct PoseMatrix {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

/// Rotation matrices as the files have them, one per pose of the trajectory; empty: those of the poses.
struct RotationsAsWritten {
  std::vector<Eigen::Matrix3d> reference, estimate;
};

/// Errors pose by pose, or pair by pair.
struct PoseErrors {
  std::vector<double> translation;   ///< [m]
  std::vector<double> rotation_deg;  ///< angle [deg]
  std::vector<double> full;  ///< Frobenius norm of E - I, the 4x4 matrix E = estimate^-1 reference [-]
};
/// Absolute errors of poses with the same index.
PoseErrors AbsoluteErrors(const std::vector<PoseMatrix>& reference, const std::vector<PoseMatrix>& estimate);
/// | |R_i - R_j| - |P_i - P_j| | of the positions of each pair [m] (evo's point_distance).
std::vector<double> PointDistanceErrors(const std::vector<PoseMatrix>& reference,
                                        const std::vector<PoseMatrix>& estimate,
                                        const std::vector<std::pair<std::size_t, std::size_t>>& pairs);
/// PointDistanceErrors over |R_i - R_j| [%]; pairs whose reference does not move are left out.
std::vector<double> PointDistanceRatios(const std::vector<PoseMatrix>& reference,
                                        const std::vector<PoseMatrix>& estimate,
                                        const std::vector<std::pair<std::size_t, std::size_t>>& pairs);
/// Relative errors of the pairs (i, j): E = (R_i^-1 R_j)^-1 (P_i^-1 P_j), reference R and estimate P (Sturm
/// et al., IROS 2012).
PoseErrors RelativeErrors(const std::vector<PoseMatrix>& reference, const std::vector<PoseMatrix>& estimate,
                          const std::vector<std::pair<std::size_t, std::size_t>>& pairs);

/// Pairs of positions in the list, `rpe_delta` apart along the estimate. Consecutive pieces start at the
/// first pose, but in metres at the first cut (as in evo). `stamps_s` is for seconds alone.
std::vector<std::pair<std::size_t, std::size_t>> RelativePairs(const std::vector<Pose>& estimate,
                                                               const std::vector<double>& stamps_s,
                                                               const EvaluationOptions& options);

/// Indices of at most `count` of `poses` poses, evenly spaced, first and last among them.
std::vector<std::size_t> EvenlySpacedPoses(std::size_t poses, std::size_t count);
/// Indices of the poses that count, the first among them.
std::vector<std::size_t> MovedPoses(const Trajectory& trajectory, const MotionFilter& filter);
/// The angles a, b, c of R = Rz(c) Ry(b) Rx(a) [rad]: roll, pitch, yaw. Where b is +-90 degrees, c is 0.
Eigen::Vector3d RollPitchYaw(const Eigen::Matrix3d& rotation);
/// The pose in the plane: its third coordinate 0, its rotation that about the plane's normal, an angle of
/// RollPitchYaw.
PoseMatrix ProjectToPlane(const PoseMatrix& pose, ProjectionPlane plane);

/// How much of the reference's span of time an estimate has poses for.
struct TrajectoryCoverage {
  std::size_t posed = 0;     ///< poses, or frames with a pose, within the span
  std::size_t all = 0;       ///< those, and frames without a pose
  std::size_t unpaired = 0;  ///< poses of the estimate within the span that are in no pair
  /// From 0 to 1.
  double share() const { return all == 0 ? 0 : static_cast<double>(posed) / static_cast<double>(all); }
};
/// An ATE says little of a run that covers less than this of the reference.
constexpr double kFullCoverage = 0.99;
/// Frames without a pose are counted by the estimate's median interval: where a gap is n intervals long, n -
/// 1 are missing, and n before the first pose and after the last. A list of keyframes has uneven gaps; give
/// `frame_stamps_s` for these, and where the reference begins before the images or ends after them.
/// `tolerance_s`: poses so far outside of the span are within it.
TrajectoryCoverage CoverageOf(const Trajectory& reference, const Trajectory& estimate, double offset_s,
                              double tolerance_s, const std::vector<double>& frame_stamps_s = {});

/// How two lists of poses were paired.
struct AssociationStatistics {
  std::size_t reference_unmatched = 0, estimate_unmatched = 0;  ///< poses in no pair
  double median_time_difference_s = 0;   ///< of a pair, without sign [s]; 0 for interpolation and by index
  double largest_time_difference_s = 0;  ///< [s]
};

/// Mean relative errors over segments of the path.
struct SegmentErrors {
  std::size_t segments = 0;        ///< 0: the path is shorter than the shortest segment
  double translation_percent = 0;  ///< mean translation error over the segment's length [%]
  double rotation_deg_per_m = 0;   ///< mean rotation error over the segment's length [deg/m]
};
using KittiErrors = SegmentErrors;

/// Over all segments of these lengths [m] along the reference, started at every `step`-th pose. The formulas
/// of KITTI's development kit: E = (P_i^-1 P_j)^-1 (R_i^-1 R_j) with general inverses, acos((tr E - 1) / 2).
SegmentErrors EvaluateSegments(const std::vector<PoseMatrix>& reference,
                               const std::vector<PoseMatrix>& estimate, const std::vector<double>& lengths_m,
                               std::size_t step);
/// KITTI's odometry errors: segments of 100, 200, ..., 800 m, started at every 10th pose (Geiger et al., CVPR
/// 2012).
KittiErrors EvaluateKitti(const std::vector<PoseMatrix>& reference, const std::vector<PoseMatrix>& estimate);
KittiErrors EvaluateKitti(const std::vector<Pose>& reference, const std::vector<Pose>& estimate);
/// Drift per metre, for paths of any length: segments of 10, 20, ..., 50 % of the path, started at every pose
/// (Zhang and Scaramuzza, IROS 2018).
SegmentErrors EvaluateDrift(const std::vector<PoseMatrix>& reference,
                            const std::vector<PoseMatrix>& estimate);

/// Where the reference or the estimate has positions alone (HasRotations), all figures that need rotations
/// are of nothing: `rotations` is false, and ate_rotation, ate_full, rpe, its rotation and full, kitti, drift
/// count 0.
struct EvaluationReport {
  bool rotations = true;
  std::size_t pairs = 0;                                ///< associated poses
  std::size_t reference_poses = 0, estimate_poses = 0;  ///< that could have been paired
  AssociationStatistics association;
  TrajectoryCoverage coverage;  ///< before downsample and motion_filter
  TrajectoryAlignment alignment = TrajectoryAlignment::kSE3;
  Similarity S_reference_estimate;           ///< the alignment that was applied
  double path_length_m = 0;                  ///< of the associated reference poses
  ErrorStatistics ate;                       ///< [m]
  ErrorStatistics ate_rotation;              ///< [deg]
  ErrorStatistics ate_full;                  ///< [-]
  ErrorStatistics rpe;                       ///< [m]; count 0 if no pair is rpe_delta apart
  ErrorStatistics rpe_rotation;              ///< [deg]
  ErrorStatistics rpe_full;                  ///< [-]
  ErrorStatistics rpe_point_distance;        ///< [m]
  ErrorStatistics rpe_point_distance_ratio;  ///< [%]
  KittiErrors kitti;
  SegmentErrors drift;
  // What the figures are of, for plots.
  AssociatedPoses poses;  ///< the estimate aligned
  PoseErrors absolute, relative;
  std::vector<double> point_distance_errors;                        ///< of `relative_pairs` [m]
  std::vector<std::pair<std::size_t, std::size_t>> relative_pairs;  ///< indices into `poses`
};

/// Associates, aligns and measures. Throws InputError as the functions above do, and if an option needs
/// rotations that are not known.
EvaluationReport EvaluateTrajectory(const Trajectory& reference, const Trajectory& estimate,
                                    const EvaluationOptions& options = {},
                                    const RotationsAsWritten& written = {});

}  // namespace tutti
#pragma GCC visibility pop
