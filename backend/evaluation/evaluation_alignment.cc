// How an estimate is laid over its reference, and the words for that.
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/umeyama.h"
#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

/// The positions that the alignment is computed from.
std::vector<Eigen::Vector3d> Positions(const std::vector<Pose>& poses, std::size_t first) {
  std::vector<Eigen::Vector3d> out;
  for (std::size_t k = 0; k < poses.size() && (first == 0 || k < first); ++k)
    out.push_back(poses[k].translation);
  return out;
}

Eigen::Vector3d Mean(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  return mean;
}

/// Position of the word; the lists below are in the order of their enumerations.
std::size_t PlaceOf(const std::vector<std::string>& names, const std::string& name, const char* what) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  throw InputError(std::string("unknown ") + what + " '" + name + "'; use one of " + JoinText(names));
}

}  // namespace

const std::vector<std::string>& TrajectoryAlignmentNames() {
  static const std::vector<std::string> names = {"none", "origin", "se3", "sim3", "scale", "yaw"};
  return names;
}

TrajectoryAlignment ParseTrajectoryAlignment(const std::string& name) {
  return static_cast<TrajectoryAlignment>(PlaceOf(TrajectoryAlignmentNames(), name, "alignment"));
}

const char* ToString(TrajectoryAlignment alignment) {
  return TrajectoryAlignmentNames().at(static_cast<std::size_t>(alignment)).c_str();
}

const std::vector<std::string>& DeltaUnitNames() {
  static const std::vector<std::string> names = {"frames", "metres", "degrees", "seconds", "radians"};
  return names;
}

DeltaUnit ParseDeltaUnit(const std::string& name) {
  return static_cast<DeltaUnit>(PlaceOf(DeltaUnitNames(), name, "unit"));
}

const char* ToString(DeltaUnit unit) { return DeltaUnitNames().at(static_cast<std::size_t>(unit)).c_str(); }

const std::vector<std::string>& ProjectionPlaneNames() {
  static const std::vector<std::string> names = {"none", "xy", "xz", "yz"};
  return names;
}

ProjectionPlane ParseProjectionPlane(const std::string& name) {
  return static_cast<ProjectionPlane>(PlaceOf(ProjectionPlaneNames(), name, "plane"));
}

const char* ToString(ProjectionPlane plane) {
  return ProjectionPlaneNames().at(static_cast<std::size_t>(plane)).c_str();
}

Similarity AlignPoints(const std::vector<Eigen::Vector3d>& reference,
                       const std::vector<Eigen::Vector3d>& estimate, bool with_scale) {
  const std::size_t n = reference.size();
  if (n != estimate.size()) throw InputError("alignment: the two lists of points differ in length");
  if (n < 3) {
    throw InputError("alignment: " + std::to_string(n) +
                     (n == 1 ? " pair of poses is" : " pairs of poses are") +
                     " too few, at least 3 are needed; use the alignment 'origin' or 'none'");
  }
  const std::optional<Similarity> S = internal::Umeyama(reference, estimate, with_scale);
  if (!S) {
    throw InputError(
        "alignment: the positions lie on a line or in one place, so the rotation is not determined; use the "
        "alignment "
        "'origin' or 'none'");
  }
  return *S;
}

Similarity AlignAboutAxis(const std::vector<Eigen::Vector3d>& reference,
                          const std::vector<Eigen::Vector3d>& estimate, const Eigen::Vector3d& axis) {
  if (reference.size() != estimate.size())
    throw InputError("alignment: the two lists of points differ in length");
  if (reference.size() < 2)
    throw InputError("alignment: 1 pair of poses is too few, at least 2 are needed; use 'origin' or 'none'");
  const Eigen::Vector3d mean_r = Mean(reference), mean_e = Mean(estimate);
  // sum r . (R e) over the parts across the axis is largest at the angle atan2(sine, cosine).
  double cosine = 0, sine = 0, spread = 0;
  for (std::size_t k = 0; k < reference.size(); ++k) {
    const Eigen::Vector3d r = reference[k] - mean_r, e = estimate[k] - mean_e;
    const Eigen::Vector3d across = e - axis.dot(e) * axis;
    cosine += r.dot(across);
    sine += r.dot(axis.cross(e));
    spread += r.squaredNorm() + e.squaredNorm();
  }
  if (!(std::hypot(cosine, sine) > 1e-14 * spread)) {
    throw InputError(
        "alignment: the positions do not move across the vertical, so the heading is not determined; use "
        "the alignment 'origin' or 'none', or another axis");
  }
  Similarity out;
  out.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(std::atan2(sine, cosine), axis));
  out.translation = mean_r - out.rotation * mean_e;
  return out;
}

Similarity AlignPoses(const AssociatedPoses& poses, const EvaluationOptions& options) {
  const auto fit = [&](bool with_scale) {
    return AlignPoints(Positions(poses.reference, options.align_first),
                       Positions(poses.estimate, options.align_first), with_scale);
  };
  switch (options.alignment) {
    case TrajectoryAlignment::kNone:
      return Similarity();
    case TrajectoryAlignment::kOrigin:
      if (poses.reference.size() < 2)
        throw InputError(
            "alignment: 1 pair of poses is too few for 'origin', whose first pair has no error; use 'none'");
      return Similarity(poses.reference.front() * poses.estimate.front().Inverse());
    case TrajectoryAlignment::kSE3:
      return fit(false);
    case TrajectoryAlignment::kSim3:
      return fit(true);
    case TrajectoryAlignment::kScale: {
      Similarity out;
      out.scale = fit(true).scale;
      return out;
    }
    case TrajectoryAlignment::kYaw:
      return AlignAboutAxis(Positions(poses.reference, options.align_first),
                            Positions(poses.estimate, options.align_first), options.vertical.normalized());
  }
  return Similarity();
}

Pose ApplyAlignment(const Similarity& S, const Pose& pose) {
  return Pose((S.rotation * pose.rotation).normalized(), S * pose.translation);
}

Eigen::Vector3d RollPitchYaw(const Eigen::Matrix3d& R) {
  const double across = std::hypot(R(0, 0), R(1, 0)), pitch = std::atan2(-R(2, 0), across);
  if (across <= 4 * std::numeric_limits<double>::epsilon()) return {std::atan2(-R(1, 2), R(1, 1)), pitch, 0};
  return {std::atan2(R(2, 1), R(2, 2)), pitch, std::atan2(R(1, 0), R(0, 0))};
}

PoseMatrix ProjectToPlane(const PoseMatrix& pose, ProjectionPlane plane) {
  if (plane == ProjectionPlane::kNone) return pose;
  const int normal = plane == ProjectionPlane::kXY ? 2 : plane == ProjectionPlane::kXZ ? 1 : 0;
  PoseMatrix out = pose;
  out.translation[normal] = 0;
  const double angle = RollPitchYaw(pose.rotation)[normal];
  out.rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::Unit(normal)).toRotationMatrix();
  return out;
}

}  // namespace tutti
