// The words for alignments and units.
#include <algorithm>

#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

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

}  // namespace tutti
