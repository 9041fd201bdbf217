#include "tutti/frontend/odometry_options.h"

namespace tutti {

std::string OdometryOptions::Validate() const {
  std::string problem = OutOfRange(*this, "odometry.");
  if (problem.empty() && fast_threshold_min > fast_threshold)
    problem = "odometry.fast_threshold_min must be at most odometry.fast_threshold";
  return problem;
}

}  // namespace tutti
